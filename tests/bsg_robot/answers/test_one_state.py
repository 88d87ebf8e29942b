"""One state, one answer: told by a file, by calls, by options or in Python, or saved and opened."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bsg_models import Predictor
from bsg_models.search.looks import miss_all
from bsg_robot import SeenBuilding, open_graph
from bsg_robot.answers.words import set_hidden_shares
from bsg_robot.graph.formats import write_belief

UNIVERSAL = Predictor()
NAMES = ("kitchen", "bathroom", "bedroom", "hall", "living room", "R0", "zzqx")
WORDS = ("stove", "bed", "toilet", "sofa", "mug", "towel", "zzqx")
ASKED = ("microwave", "mug", "towel", "pillow", "bag")
State = dict[str, Any]


def draw(seed: int) -> State:
    """Return a document that says all: each room hides all, nearly all, half or nothing."""
    rng = np.random.default_rng(seed)
    rooms, objects = [], []
    for name in rng.permutation(NAMES)[: rng.integers(2, 6)]:
        share = float(rng.choice([1.0, 1.0, 0.99, 0.5, 0.0]))
        rooms.append({"id": str(name), "visited": share < 1, "hidden_share": share})
        for word in rng.choice(WORDS, rng.integers(0, 4)):
            score = {"score": float(rng.choice([0.2, 0.8]))} if rng.random() < 0.3 else {}
            thing = {"id": str(len(objects)), "room": str(name), "category": str(word)}
            objects.append(thing | score)
    pairs = [[room["id"], beside["id"]] for room, beside in pairwise(rooms)]
    more = {"more_rooms": int(rng.integers(0, 3))}
    return {"scene_id": "home", "rooms": rooms, "objects": objects, "adjacency": pairs, **more}


@cache
def by_document(seed: int) -> list[Any]:
    """Return the answers to a document."""
    return answer(open_graph(draw(seed), model=UNIVERSAL))


def by_calls(state: State, folder: Path) -> SeenBuilding:
    """Rooms are discovered, entered and searched, and things are seen, in another order."""
    seen = open_graph({"scene_id": "home", "rooms": [], "more_rooms": 0}, model=UNIVERSAL)
    for number, room in enumerate(state["rooms"]):
        beside = [state["rooms"][number - 1]["id"]] if number else []
        seen.discovered(room["id"], beside=beside)
    for thing in state["objects"][::2]:
        seen.saw(thing["room"], thing["category"], object_id=thing["id"], score=thing.get("score"))
    for room in state["rooms"]:
        if room["visited"]:
            seen.entered(room["id"], hidden_share=room["hidden_share"])
        if room["hidden_share"] == 0:
            seen.searched(room["id"])
    for thing in state["objects"]:
        seen.saw(thing["room"], thing["category"], object_id=thing["id"], score=thing.get("score"))
    seen.more_rooms(state["more_rooms"])
    return seen


def by_options(state: State, folder: Path) -> SeenBuilding:
    """The file says half of each room; the shares are said later."""
    half = [room | {"hidden_share": 0.5, "visited": True} for room in state["rooms"]]
    graph = open_graph({**state, "rooms": half}, model=UNIVERSAL).graph
    shares = {room["id"]: room["hidden_share"] for room in state["rooms"]}
    return SeenBuilding(set_hidden_shares(graph, rooms=shares), UNIVERSAL)


def by_saving(state: State, folder: Path) -> SeenBuilding:
    write_belief(by_calls(state, folder).belief(), folder / "saved.json")
    return open_graph(folder / "saved.json", model=UNIVERSAL)


def answer(seen: SeenBuilding) -> list[Any]:
    """Return all that is answered, as numbers and names."""
    shares = [(room.name, room.visited, room.hidden_share) for room in seen.graph.rooms]
    kinds = [[(kind.name, kind.probability) for kind in seen.kinds(r)] for r in seen.rooms]
    likely = {f"{t} {p.room}": p.probability for t in ASKED for p in seen.where(t)}
    building = [seen.graph.hidden_share, *(seen.anywhere(thing) for thing in ASKED)]
    go = [seen.next_room(thing, here=seen.rooms[0]) for thing in ASKED]
    return [shares, kinds, likely, building, go]


@pytest.mark.parametrize("door", [by_calls, by_options, by_saving])
def test_the_same_state_has_the_same_answers(
    door: Callable[[State, Path], SeenBuilding], tmp_path: Path
) -> None:
    for seed in range(6):
        state = draw(seed)
        expected = by_document(seed)
        shares, kinds, likely, building, go = answer(door(state, tmp_path))
        assert shares == expected[0], state
        assert kinds == expected[1], state
        assert likely == pytest.approx(expected[2], abs=1e-9), state
        assert building == pytest.approx(expected[3], abs=1e-9), state
        assert go == expected[4], state


def test_looks_say_the_same_however_they_are_reported(tmp_path: Path) -> None:
    """One by one, in a map, as another word, or as one look that misses what they do."""
    rooms = [{"id": "kitchen", "visited": False}, {"id": "hall", "visited": False}]
    sink = [{"id": "sink 1", "room": "kitchen", "category": "sink"}]
    home = {"scene_id": "home", "rooms": rooms, "objects": sink, "more_rooms": 0}
    chances = (0.8, 0.8, 0.5)
    looks = [{"room": "kitchen", "thing": "mug", "chance": chance} for chance in chances]
    each, words, joined = open_graph(home), open_graph(home), open_graph(home)
    for chance, word in zip(chances, ("mug", "mugs", "mug"), strict=True):
        each.looked("kitchen", "mug", chance=chance)
        words.looked("kitchen", word, chance=chance)
    joined.looked("kitchen", "mug", chance=1 - miss_all(chances))
    assert each.graph.looks == joined.graph.looks
    write_belief(each.belief(), tmp_path / "saved.json")
    for seen in (
        words,
        joined,
        open_graph({**home, "looks": looks}),
        open_graph(tmp_path / "saved.json"),
    ):
        assert seen.where("mug")[0].probability == pytest.approx(each.where("mug")[0].probability)
        assert seen.next_room("mug", here="kitchen") == each.next_room("mug", here="kitchen")
