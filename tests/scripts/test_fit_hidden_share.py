"""The camera that measures the constants of the hidden share, in rooms made by hand."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from conftest import load_script

from bsg_data.observation.hidden_share import CURVES, Sight

FIT = load_script("fit/hidden_share")
SQUARE = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])
ELL = np.array([[0.0, 0], [4, 0], [4, 4], [2, 4], [2, 2], [0, 2]])  # without its upper left
EYE = np.array([1.0, 1.0])


def test_a_camera_sees_what_is_in_front_and_in_range() -> None:
    points = np.array([[3.0, 1], [3.0, 2.9], [3.0, 3.1], [0.5, 1], [3.9, 1.0]])
    assert FIT.sees(EYE, 0.0, points, SQUARE).tolist() == [True, True, False, False, True]
    far = np.array([[1.0 + FIT.RANGE + 0.1, 1.0]])
    assert not FIT.sees(EYE, 0.0, far, SQUARE * 10).any()


def test_a_wall_hides_what_is_behind_it() -> None:
    points = np.array([[3.5, 2.5], [3.0, 1.0], [2.2, 3.9], [2.0, 3.0]])
    assert FIT.crosses(EYE, points, ELL).tolist() == [False, False, True, True]


def test_a_box_hides_what_is_behind_it_and_not_what_is_in_it() -> None:
    boxes = np.array([[[2.0, 0.5, 0.0], [2.5, 1.5, 2.0]], [[3.0, 0.9, 0.0], [3.2, 1.1, 0.5]]])
    points = np.array([[2.2, 1.0, 1.0], [3.1, 1.0, 0.2], [3.1, 3.0, 0.2], [1.5, 1.0, 1.0]])
    behind = FIT.is_behind(np.array([1.0, 1.0, 1.2]), points, boxes, np.array([0, 1, 1, 1]))
    assert behind.tolist() == [False, True, False, False]


def test_a_walk_sees_more_and_more(tmp_path: Path) -> None:
    """A house of one room: what is in its fridge is no object of it."""
    apple = {"id": "Apple|4|0", "assetId": "Apple_1", "position": {"x": 1, "y": 1, "z": 1}}
    things = [
        {"id": f"4|{n}", "assetId": "Bed_1", "position": {"x": x, "y": 0.5, "z": 3.5}}
        for n, x in enumerate((0.5, 2.0, 3.5))
    ]
    fridge = {"id": "4|9", "assetId": "Fridge_1", "position": {"x": 3.5, "y": 1, "z": 0.5}}
    room = {"id": "room|4", "floorPolygon": [{"x": x, "z": y} for x, y in SQUARE]}
    house = {"rooms": [room], "objects": [*things, {**fridge, "children": [apple]}]}
    path = tmp_path / "houses.jsonl.gz"
    path.write_bytes(gzip.compress(json.dumps(house).encode()))
    (space,) = FIT.read_procthor(path)
    assert space.objects.shape == (4, 1, 3)
    moments = list(FIT.walk(space, np.random.default_rng(0)))
    assert [moment.seconds_inside for moment in moments] == list(FIT.MOMENTS)
    for name, direction in (("floor_in_view", 1), ("walls_in_view", 1), ("unseen", -1)):
        course = [getattr(moment, name) for moment in moments]
        assert (np.diff(course) * direction >= 0).all(), name
    assert moments[0].unseen > moments[-1].unseen == 0
    assert moments[-1].floor_in_view > FIT.ALL
    assert {moment.floor_area for moment in moments} == {16.0}


@pytest.mark.parametrize("kind", ["floor", "seconds and area"])
def test_a_fit_finds_the_curve_that_objects_were_drawn_from(kind: str) -> None:
    rng, number = np.random.default_rng(0), 4000
    sight = Sight(
        floor_in_view=rng.random(number),
        seconds_inside=rng.uniform(0, 60, number),
        floor_area=rng.uniform(4, 40, number),
    )
    true = CURVES[kind]
    hidden = 1 - np.asarray(true.seen(true.constants, sight))
    share = rng.beta(true.size * hidden, true.size * (1 - hidden))
    objects = np.full(number, 15)
    table = FIT.Table(
        *(sight.seconds_inside, sight.floor_area, sight.floor_in_view, np.zeros(number)),
        *(rng.binomial(objects, share).astype(float), objects.astype(float)),
    )
    found = FIT.fit_curve(kind, table)
    np.testing.assert_allclose(found.seen(found.constants, sight), 1 - hidden, atol=0.03)
    assert found.size == pytest.approx(true.size, rel=0.1)
