"""Search a home for three things, with beliefs as the prior of a planner.

    python search_with_a_planner.py

The planner here is a few lines, which go where a second of search finds most. It asks for
probabilities as RAIL-group/railroad does (docs/robot-software.md): of every robot, location and
object, before every decision.
"""

from __future__ import annotations

from collections.abc import Callable

from bsg_models import FindProbability, open_graph

# What the robot knows: four rooms of a home, and what it saw through their doors.
HOME = {
    "scene_id": "home",
    "building_kind": "home",
    "rooms": [
        {"id": "hall", "room_type": "corridor", "hidden_share": 0.2},
        {"id": "kitchen", "visited": False, "room_type": "kitchen"},
        {"id": "bathroom", "visited": False, "room_type": "bathroom"},
        {"id": "bedroom", "visited": False, "room_type": "bedroom"},
    ],
    "objects": [
        {"id": "1", "room": "kitchen", "category": "kitchen cabinet"},
        {"id": "2", "room": "bathroom", "category": "sink"},
        {"id": "3", "room": "bedroom", "category": "bed"},
    ],
    "adjacency": [["hall", "kitchen"], ["hall", "bathroom"], ["hall", "bedroom"]],
}
# Where it can search: location → (room, seconds from the hall, seconds of search).
LOCATIONS = {
    "countertop_1": ("kitchen", 20.0, 10.0),
    "shelf_2": ("kitchen", 22.0, 5.0),
    "washstand_3": ("bathroom", 12.0, 5.0),
    "bedside_4": ("bedroom", 15.0, 5.0),
    "bed_5": ("bedroom", 16.0, 10.0),
}
SIZES = {"countertop_1": 3.0, "bed_5": 3.0}  # of where things lie, m²; the others have 1
THINGS = ("towel", "microwave", "pillow_7")
# What nobody told the robot.
TRUTH = {"washstand_3": ("towel",), "countertop_1": ("microwave",), "bed_5": ("pillow_7",)}


def search(
    probability: Callable[[str, str, str], float], tell: Callable[[str, tuple[str, ...]], None]
) -> float:
    """Search until all things are found, and return the seconds that it took."""
    missing, seconds = set(THINGS), 0.0
    while missing:
        rates = {  # things found a second
            location: sum(probability("robot1", location, thing) for thing in sorted(missing))
            / (way + look)
            for location, (_, way, look) in LOCATIONS.items()
        }
        here = max(rates, key=rates.__getitem__)
        found = tuple(sorted(missing & set(TRUTH.get(here, ()))))
        seconds += sum(LOCATIONS[here][1:])
        print(f"{here}: {', '.join(found) or 'nothing'}")
        missing -= set(found)
        tell(here, found)
    return seconds


if __name__ == "__main__":
    seen = open_graph(HOME)
    rooms = {location: room for location, (room, *_) in LOCATIONS.items()}
    belief = FindProbability(seen, {**rooms, "start": None}, sizes=SIZES)
    print(f"all found after {search(belief, belief.searched):.0f} s")
