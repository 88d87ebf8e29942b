"""Recordings, as Rerun's own reader reads them back, hold what was written."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from random_beliefs import make_belief
from recordings import name_recording, read_recording
from refusals import refuses
from replays import make_replay

from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import KnownRoom
from bsg_models.rendering import recording
from bsg_models.rendering.recording import write_recording, write_search

CLOSE = 0.0051  # metres: outlines are in whole centimetres, as on a plan


@pytest.mark.parametrize("seed", range(6))
def test_a_belief_comes_back(seed: int, tmp_path: Path) -> None:
    belief, path = make_belief(seed), tmp_path / "new" / "belief.rrd"
    write_recording([belief], path)
    found, partial = read_recording(path), belief.partial
    for node, room in enumerate(partial.rooms, 1):
        entity = f"world/rooms/{room.name}"
        assert found[f"expected/{room.name} scalars"] == [[belief.hidden[node].sum()]]
        assert found[f"{entity} labels"][0][0].startswith(room.label or room.name)
        if room.box is not None:
            (centre,), (half,) = found[f"{entity} centers"][0], found[f"{entity} half_sizes"][0]
            assert np.subtract(centre, half) == pytest.approx(room.box.minimum, abs=CLOSE)
            assert np.add(centre, half) == pytest.approx(room.box.maximum, abs=CLOSE)
    for c, name in enumerate([*partial.class_space.classes, "no class"]):
        seen = [
            one
            for one in partial.objects
            if c == (45 if one.class_index is None else one.class_index)
        ]
        entity = f"world/objects/{name}"
        assert found.get(f"{entity} labels", [[]]) == [[one.raw_category for one in seen]]
        for one, spot in zip(seen, found.get(f"{entity} positions", [[]])[0], strict=True):
            assert one.position is None or spot == pytest.approx(one.position, abs=CLOSE)
        blind = [one for one in belief.blind if one.class_index == c]
        entity = f"world/blind/{name}"
        assert found.get(f"{entity} presence", [[]]) == [[one.presence for one in blind]]
        assert found.get(f"{entity} expected", [[]]) == [[one.expected for one in blind]]
        rooms = [partial.rooms[one.room_index - 1].name for one in blind]
        assert found.get(f"{entity} room", [[]]) == [rooms]
    assert len(found["world/adjacency strips"][0]) == len(partial.adjacency)


def test_graphs_are_steps_and_what_is_not_known_is_not_there(tmp_path: Path) -> None:
    beliefs = [make_belief(seed) for seed in range(5)]
    write_recording(beliefs, tmp_path / "growing.rrd")
    found = read_recording(tmp_path / "growing.rrd")
    for name in ("r0", "r3"):
        known = [name in [room.name for room in one.partial.rooms] for one in beliefs]
        assert [len(row) for row in found[f"world/rooms/{name} centers"]] == known
        assert [len(row) for row in found[f"expected/{name} scalars"]] == known
    assert len(found["belief text"]) == 5
    write_recording([], tmp_path / "empty.rrd")


def test_rooms_that_nobody_placed_stand_beside_the_others(tmp_path: Path) -> None:
    placed = KnownRoom("placed", 0.5, position=(3.0, 4.0, 1.0))
    rooms = (placed, *(KnownRoom(f"loose {k}", 0.5) for k in range(3)))
    belief = make_belief(0)
    partial = replace(belief.partial, rooms=rooms, objects=(), adjacency=())
    blind = tuple(replace(belief.blind[0], room_index=1 + k % 4) for k in range(20))
    shape = (5, belief.expected.shape[1])
    none = np.zeros(shape)
    write_recording(
        [replace(belief, partial=partial, blind=blind, expected=none, presence=none)],
        tmp_path / "b.rrd",
    )
    found = read_recording(tmp_path / "b.rrd")
    centres = [found[f"world/rooms/{room.name} centers"][0][0] for room in rooms]
    assert centres[0] == pytest.approx((3.0, 4.0, 2.25))
    assert all(centre[0] > 3.0 + 2.4 for centre in centres[1:])
    for a, b in pairwise(sorted(centres)):
        assert max(abs(p - q) for p, q in zip(a, b, strict=True)) >= 2.4 - CLOSE
    name = partial.class_space.classes[blind[0].class_index]
    for one, spot in zip(blind, found[f"world/blind/{name} centers"][0], strict=True):
        gap = np.abs(np.subtract(spot, centres[one.room_index - 1]))
        assert (gap <= (1.2, 1.2, 1.25 + CLOSE)).all(), "it is in its room"


def test_a_search_comes_back_step_by_step(tmp_path: Path) -> None:
    replay = make_replay()
    write_search(replay, tmp_path / "search.rrd")
    found = read_recording(tmp_path / "search.rrd")
    assert found["probability/kitchen scalars"] == [[0.6], [0.9], [0.0], [0.0]]
    assert found["travelled/nearest scalars"] == [[0.0], [3.0], [6.5], [16.0]]
    assert [row[0] for row in found["world/robot/expected-cost labels"]] == [
        *["expected-cost"] * 2,
        *["expected-cost found sink"] * 2,
    ]
    assert [row[0] for row in found["world/rooms/kitchen labels"]] == [
        *("kitchen 60%", "kitchen 90%"),
        *["kitchen"] * 2,
    ]
    (way,) = found["world/robot/expected-cost/path strips"][-1]
    rooms = [
        found[f"world/rooms/{name} centers"][0][0]
        for name in ("hall", "bedroom 1", "hall", "kitchen")
    ]
    assert [spot[:2] for spot in way] == [room[:2] for room in rooms]
    assert found["world/sought positions"][0] == [rooms[-1]]


def test_the_same_content_has_the_same_id(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.rrd" for name in "abc"]
    for seed, path in zip((1, 1, 2), paths, strict=True):
        write_recording([make_belief(seed)], path)
    first, second, other = map(name_recording, paths)
    assert first == second != other
    a, b = (read_recording(path) for path in paths[:2])
    assert {**a, "__properties name": []} == {**b, "__properties name": []}
    assert [name_recording(path)[1] for path in paths] == [1, 1, 1]


def test_a_missing_library_is_told_before_anything_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "find_spec", lambda name: None)
    with refuses(RecipeError, "library-missing"):
        write_recording(
            iter(lambda: pytest.fail("a graph was asked for"), None), tmp_path / "b.rrd"
        )
    assert list(tmp_path.iterdir()) == []
