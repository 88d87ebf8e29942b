from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest
from conftest import annotation_text, write_scene
from one_building import read_pairs
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset, read_cells, read_splits
from bsg_data.dataset.histograms import to_histograms
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.mask_hash import hash_splits
from bsg_data.observation.pairs import (
    list_column,
    read_views,
    stream_pairs,
    write_pairs,
)
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import Edge, SceneGraph
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.source import SceneRef
from bsg_data.testing import draw_mask


@pytest.mark.parametrize(("strategy", "withhold"), [("uniform", 0.2), ("mixed", 0)])
def test_pairs_are_the_masks_of_their_recipe_in_order(
    dataset: Path, strategy: str, withhold: float
) -> None:
    mask = MaskRecipe(strategy=strategy, fraction=0.4, seed=3, withhold=withhold)
    write_pairs(dataset, PairsRecipe(mask=mask, draws=3), force=True)
    cells = read_cells(dataset)
    for split, scenes in read_splits(dataset).items():
        table = read_pairs(dataset, split)
        views = read_views(table)
        expected, first = [], 0
        for scene in scenes:
            for draw in range(3):
                view, found, hidden = draw_mask(cells[scene], mask, scene_id=scene, draw=draw)
                inputs = to_histograms(found - hidden)
                expected += [
                    (scene, draw, node, bool(view.visited[row]), tuple(inputs[row]))
                    for row, node in enumerate(view.nodes.tolist())
                ]
                assert views.take(first, first + len(inputs)).agrees(view)
                first += len(inputs)
        keys = table.select(["scene_id", "draw", "node_index", "visited"]).to_pylist()
        rows = list_column(table, "input")
        stored = [(*k.values(), tuple(row)) for k, row in zip(keys, rows, strict=True)]
        assert stored == expected
        targets = list_column(table, "target")
        assert (rows <= targets).all()
    assert check_dataset(dataset) == ()


def test_the_same_bytes_with_any_number_of_workers(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bsg_data.observation.pairs.SCENES_PER_FILE", 3)
    monkeypatch.setattr("bsg_data.observation.pairs.ROWS_PER_GROUP", 10)
    alone = write_pairs(dataset, PairsRecipe(draws=5), force=True)
    with ThreadPoolExecutor(4) as pool:
        many = write_pairs(dataset, PairsRecipe(draws=5), force=True, executor=pool)
    assert alone == many
    assert len(alone.files_of("pairs")) == 6  # 10 buildings of train in four files


def test_pairs_need_force_to_be_replaced(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    with refuses(DatasetError, "pairs-exist", where=dataset):
        write_pairs(dataset, PairsRecipe())
    assert read_manifest(dataset) == manifest


def test_a_building_beyond_the_format_is_refused(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bsg_data.observation.pairs._MOST", 10)
    before = read_manifest(dataset)
    with refuses(DatasetError, "building-too-large", "00006-abcdefghi06"):
        write_pairs(dataset, PairsRecipe(), force=True)
    assert read_manifest(dataset) == before
    assert check_dataset(dataset) == ()


def test_adjacency_reaches_the_masks(tmp_path: Path) -> None:
    """A source that knows adjacency: what `frontier` leaves unvisited follows it."""
    rooms = 12

    class Chain(HM3DFolder):
        def read(self, ref: SceneRef, class_map: ClassMap) -> SceneGraph:
            edges = [Edge(k, k + 1, "adjacent", "layout") for k in range(1, rooms)]
            reading = super().read(ref, class_map)
            return replace(reading, graph=replace(reading.graph, adjacency=tuple(edges)))

    for number in range(10):
        text = annotation_text({k: ["chair"] * 6 for k in range(rooms)})
        write_scene(tmp_path / "hm3d", f"{number:05d}-abcdefghi{number:02d}", text)
    out = tmp_path / "dataset"
    build_dataset(Chain(tmp_path / "hm3d"), out)
    known = Dataset.open(out).connections("00000-abcdefghi00")
    assert known.pairs.tolist() == [[k, k + 1] for k in range(1, rooms)]
    split_dataset(out, SplitRecipe())
    write_pairs(out, PairsRecipe(mask=MaskRecipe(strategy="frontier"), draws=20))
    assert check_dataset(out) == ()
    visited = read_pairs(out, "train")["visited"].to_numpy().reshape(-1, rooms + 1)[:, 1:]
    assert not visited.all()
    changes = (visited[:, 1:] != visited[:, :-1]).sum(axis=1)
    assert changes.max() <= 2  # one run of visited rooms along the chain


def test_pairs_of_many_rows_are_written_and_read_in_pieces(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of any size of a row group the pairs are the same, and so is their hash."""
    recipe = PairsRecipe(draws=5)
    write_pairs(dataset, recipe, force=True)
    whole, data = read_pairs(dataset, "train"), Dataset.open(dataset)
    expected = hash_splits(data)
    monkeypatch.setattr("bsg_data.observation.pairs.ROWS_PER_GROUP", 7)
    write_pairs(dataset, recipe, force=True)
    pieces = list(stream_pairs(Dataset.open(dataset), "train"))
    assert len(pieces) > 3 * len(set(whole["scene_id"].to_pylist()))
    assert all(piece["node_index"][0].as_py() == 0 for piece in pieces)
    assert pa.concat_tables(pieces) == whole
    assert hash_splits(Dataset.open(dataset)) == expected
