"""What rooms hold: what the tables say, in bytes and in tallies."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bsg_data.dataset.dataset import Dataset
from bsg_models.zoo.complete_rooms import read_rooms, tally_rooms


def test_rooms_are_in_the_order_that_is_asked_for(dataset: Path) -> None:
    data = Dataset.open(dataset)
    scenes = data.scene_ids[::-2]
    counts, building = read_rooms(data, scenes, most=3)
    assert counts.dtype == np.uint8
    for number, scene in enumerate(scenes):
        np.testing.assert_array_equal(
            counts[building == number], np.minimum(data.cells(scene)[1:], 3)
        )


def test_a_tally_is_that_of_all_rooms_at_once(dataset: Path) -> None:
    data = Dataset.open(dataset)
    rooms = np.concatenate([data.cells(scene)[1:] for scene in data.scene_ids])
    tallies = tally_rooms(data, data.scene_ids)
    assert len(tallies) == rooms.shape[1]
    for column, (values, times) in zip(rooms.T, tallies, strict=True):
        np.testing.assert_array_equal([values, times], np.unique(column, return_counts=True))
