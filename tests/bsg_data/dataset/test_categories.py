from __future__ import annotations

from pathlib import Path

from bsg_data.dataset.dataset import Dataset, read_cells
from bsg_data.dataset.histograms import NO_CATEGORY, choose_vocabulary
from bsg_data.dataset.shards import read_table


def test_every_object_is_in_one_cell(dataset: Path) -> None:
    data = Dataset.open(dataset)
    cells, others = read_cells(dataset), {scene: data.others(scene) for scene in data.scene_ids}
    assert cells.keys() == others.keys()
    number = sum(c.sum() for c in cells.values()) + sum(o.cells.sum() for o in others.values())
    assert number == len(read_table(dataset, "objects"))
    for scene, one in others.items():
        assert one.cells.shape == (len(cells[scene]), len(one.categories))
        assert list(one.categories) == sorted(set(one.categories))


def test_the_cells_of_one_building_by_hand(dataset: Path) -> None:
    """Building 1: kitchen, bathroom, one bedroom, and two objects in no room."""
    others = Dataset.open(dataset).others("00001-abcdefghi01")
    where = {name: others.cells[:, k].tolist() for k, name in enumerate(others.categories)}
    assert where["wall"] == [0, 1, 1, 1]
    assert where[NO_CATEGORY] == [0, 0, 2, 1]  # unknown and blank in the bathroom; zzqx thing
    assert "chair" not in where


def test_a_vocabulary_is_what_enough_buildings_have(dataset: Path) -> None:
    data = Dataset.open(dataset)
    others = [data.others(scene) for scene in data.scene_ids]
    everywhere = choose_vocabulary(others, min_scenes=12)
    assert "wall" in everywhere
    assert NO_CATEGORY not in everywhere
    assert choose_vocabulary(others, min_scenes=13) == ()
    assert set(everywhere) <= set(choose_vocabulary(others, min_scenes=1))
