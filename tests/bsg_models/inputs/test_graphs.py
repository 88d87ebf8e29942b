from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch_geometric.loader import DataLoader

from bsg_data.dataset.histograms import read_cells, to_histograms
from bsg_data.dataset.splits import read_splits, split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_models.inputs.graphs import EdgeSet, MaskedGraphs, connect, open_dataset, reconnect


def test_edges_by_hand() -> None:
    assert connect(3, ("up",)).tolist() == [[1, 2], [0, 0]]
    assert connect(3, ("down",)).tolist() == [[0, 0], [1, 2]]
    assert connect(3, ("up", "down")).tolist() == [[0, 0, 1, 2], [1, 2, 0, 0]]
    assert connect(4, ("adjacent",), adjacent=[(1, 3)]).tolist() == [[1, 3], [3, 1]]
    assert connect(4, ("complete",)).shape == (2, 6)
    assert connect(1, ("up", "down")).shape == (2, 0)
    assert connect(3, ()).shape == (2, 0)


@pytest.mark.parametrize("part", ["train", "val", "test"])
def test_stored_graphs_are_the_stored_pairs(dataset: Path, part: str) -> None:
    graphs = MaskedGraphs.stored(dataset, part)  # type: ignore[arg-type]
    cells = read_cells(dataset)
    scenes = read_splits(dataset)[part]
    assert [(g.scene_id, g.draw) for g in graphs] == [(s, d) for s in scenes for d in range(4)]
    for graph in graphs:
        assert graph.y.numpy().tolist() == to_histograms(cells[graph.scene_id]).tolist()
        assert (graph.x <= graph.y).all()
        assert graph.is_building.tolist() == [True] + [False] * (len(graph.x) - 1)
        assert (graph.fraction == 0.5).all()
        assert graph.visited.all()


def test_fresh_masks_are_the_stored_ones_of_the_same_recipe_and_draw(dataset: Path) -> None:
    stored = MaskedGraphs.stored(dataset, "train")
    for draw in range(4):
        fresh = MaskedGraphs.fresh(dataset, "train", mask=MaskRecipe(), draw=draw)
        for graph in fresh:
            (same,) = [s for s in stored if (s.scene_id, s.draw) == (graph.scene_id, draw)]
            assert torch.equal(graph.x, same.x)


@pytest.mark.parametrize("edges", [("up", "down"), ("complete",), ("down", "adjacent"), ()])
def test_a_batch_is_reconnected_as_if_it_had_been_made_so(
    dataset: Path, edges: tuple[EdgeSet, ...]
) -> None:
    graphs = MaskedGraphs.stored(dataset, "train")
    adjacency = {one.scene_id: [(1, 2)] for one in graphs.masked}
    batches = [
        next(
            iter(
                DataLoader(
                    MaskedGraphs(graphs.masked, edges=kinds, adjacency=adjacency), batch_size=7
                )
            )
        )
        for kinds in (("up",), edges)
    ]
    found = reconnect(batches[0], edges).edge_index
    assert sorted(map(tuple, found.T.tolist())) == sorted(
        map(tuple, batches[1].edge_index.T.tolist())
    )


def test_a_batch_keeps_buildings_apart(dataset: Path) -> None:
    graphs = MaskedGraphs.stored(dataset, "train")
    (batch,) = DataLoader(graphs, batch_size=len(graphs))
    source, target = batch.edge_index
    assert torch.equal(batch.batch[source], batch.batch[target])
    assert batch.is_building.sum() == len(graphs)
    assert len(batch.scene_id) == len(graphs)


def test_folds_rotate_and_never_overlap(dataset: Path) -> None:
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=3), force=True)
    write_pairs(dataset, PairsRecipe(draws=1))
    data = open_dataset(dataset)
    tested: list[str] = []
    for fold in range(3):
        parts = [set(data.scenes_of(part, fold=fold)) for part in ("train", "val", "test")]
        assert set.union(*parts) == set(data.cells)
        assert sum(map(len, parts)) == len(data.cells)
        assert len(MaskedGraphs.stored(dataset, "train", fold=fold)) == len(parts[0])
        tested += parts[2]
    assert sorted(tested) == sorted(data.cells)
    with pytest.raises(DatasetError, match="say which one to test on"):
        data.scenes_of("test")
    with pytest.raises(DatasetError, match="there is no fold 3"):
        data.scenes_of("test", fold=3)


def test_a_changed_dataset_is_opened_again(dataset: Path) -> None:
    first = open_dataset(dataset)
    assert open_dataset(dataset) is first
    split_dataset(dataset, SplitRecipe(seed=1), force=True)
    assert open_dataset(dataset).splits != first.splits


def test_what_is_missing_is_said(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no such folder"):
        MaskedGraphs.stored(tmp_path / "none", "train")
    with pytest.raises(DatasetError, match="there is no fold 0"):
        MaskedGraphs.stored(dataset, "train", fold=0)
    split_dataset(dataset, SplitRecipe(ratios=(0.5, 0.5, 0.0)), force=True)
    with pytest.raises(DatasetError, match="its test split is empty"):
        MaskedGraphs.stored(dataset, "test")
    with pytest.raises(DatasetError, match="run `bsg-data pairs` first"):
        MaskedGraphs.stored(dataset, "train")
    assert np.shape(MaskedGraphs.fresh(dataset, "val", mask=MaskRecipe(), draw=0)[0].x)[1] == 45
