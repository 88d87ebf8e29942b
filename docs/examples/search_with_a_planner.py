"""Search a home for three things, with beliefs as the prior of a planner.

    python search_with_a_planner.py

`FindProbability` answers what RAIL-group/railroad asks (docs/robot-software.md): the probability
that a search of a location finds a thing, for every robot, location and thing, before every
decision. Copy the class into your planner. The planner here is a few lines, which go where a second
of search finds most.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from bsg_data import RecipeError
from bsg_robot import Place, SeenBuilding, open_graph

NUMBERED = re.compile(r"(.+?)_[0-9]+")  # cup_4: one cup of several, as simulators name them
ON_ITS_WAY = "_loc"  # suffix of a robot's name: where railroad puts it after an interrupted move


class FindProbability:
    """The probability that a search of a location finds a thing, as a planner asks for it.

    The unsearched locations of a room share it by size. If the room hides a thing with probability
    p, a location with the share s of the room hides it with 1 − (1 − p)^s, so the room hides none
    exactly if no location does. An object seen in the room is at one of these locations, at each
    with probability s. For a searched location the answer is 1 or 0.

    A thing is any word. A number at its end (`cup_4`) means one of several; a seen object counts as
    this one only if it has this very id.

    Args:
        seen: what a robot has seen; later changes of it change the answers.
        locations: the planner's location → id of its room; None for a place that holds nothing,
            such as the start.
        sizes: location → size above 0, compared within a room: surface, or number of things. The
            default size is 1.
        words: the planner's name of a thing → a word for it, if the name is not a word.
        otherwise: probability of a word that means no thing; None raises.
    """

    def __init__(
        self,
        seen: SeenBuilding,
        locations: Mapping[str, str | None],
        *,
        sizes: Mapping[str, float] | None = None,
        words: Mapping[str, str] | None = None,
        otherwise: float | None = None,
    ) -> None:
        self.seen, self.locations, self.sizes = seen, dict(locations), dict(sizes or {})
        self.words, self.otherwise = dict(words or {}), otherwise
        self.searched_locations: set[str] = set()
        self.found: dict[str, str] = {}  # thing → the location where it was found
        self.graph = seen.graph  # that the cached places belong to
        self.places: dict[str, dict[str | None, Place] | None] = {}  # thing → room → place

    def __call__(self, robot: str, location: str, thing: str) -> float:
        """Return P(a search of the location finds the thing).

        All robots share one knowledge. A robot's position during a move (`robot1_loc`) holds
        nothing; any other unknown location is a `KeyError`.
        """
        if self.graph is not self.seen.graph:
            self.graph, self.places = self.seen.graph, {}
            rooms = {one.name: self.seen.rooms[one.room_index - 1] for one in self.graph.objects}
            self.found = {  # without what was moved
                one: at for one, at in self.found.items() if rooms.get(one) == self.locations[at]
            }
        if location not in self.locations and location.endswith(ON_ITS_WAY):
            return 0.0
        room = self.locations[location]
        if thing in self.found:
            return float(self.found[thing] == location)
        if room is None:
            return 0.0
        if thing not in self.places:
            self.places[thing] = self._look(thing)
        places = self.places[thing]
        if places is None:
            return 0.0 if location in self.searched_locations else float(self.otherwise or 0.0)
        place, is_one_of_several = places[room], NUMBERED.fullmatch(thing) is not None
        seen = [one for one in place.seen if one == thing or not is_one_of_several]
        if any(self.found.get(one) == location for one in seen):
            return 1.0
        if location in self.searched_locations:
            return 0.0
        share = self.sizes.get(location, 1.0) / self._unsearched(room)
        if any(one not in self.found for one in seen):
            return share
        return float(1 - (1 - place.unseen) ** share)

    def searched(self, location: str, found: Iterable[str] = ()) -> None:
        """Report that everything at a location was seen, and the things that are there.

        A room counts as searched when all its locations are. Until then, each searched location
        lowers what the room hides by its share.
        """
        room = self.locations[location]
        if room is None:
            raise ValueError(f"{location!r} holds nothing, so it cannot be searched")
        for name in found:
            self.seen.saw(room, self._word(name), object_id=name)
            self.found[name] = location
        if location not in self.searched_locations:
            before = self._unsearched(room)
            self.searched_locations.add(location)
            left = self._unsearched(room) / before
            share = self.seen.graph.rooms[self.seen.rooms.index(room)].share
            less = replace(share, mean=share.mean * left, sd=share.sd * left)
            self.seen.entered(room, hidden_share=less)

    def _look(self, thing: str) -> dict[str | None, Place] | None:
        """Return where a thing may be; None if it means no thing and `otherwise` is set."""
        try:
            return {place.room: place for place in self.seen.where(self._word(thing))}
        except RecipeError:
            if self.otherwise is None:
                raise
            return None

    def _word(self, thing: str) -> str:
        numbered = NUMBERED.fullmatch(thing)
        return self.words.get(thing, thing if numbered is None else numbered[1])

    def _unsearched(self, room: str) -> float:
        """Return the total size of a room's unsearched locations."""
        left = (one for one, at in self.locations.items() if at == room)
        return sum(self.sizes.get(one, 1.0) for one in left if one not in self.searched_locations)


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
