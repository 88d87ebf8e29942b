from __future__ import annotations

from pathlib import Path

import pytest
import torch
from one_building import observe_building, surround_rooms
from torch_geometric.loader import DataLoader

from bsg_data.dataset.dataset import Dataset, read_cells, read_splits
from bsg_data.dataset.histograms import to_histograms
from bsg_data.observation.observation import stack
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES
from bsg_models.ceci.masked_graphs import MaskedGraphs, to_graph
from bsg_models.inputs.graphs import read_split
from bsg_models.zoo.settings import EdgeSet


def test_a_graph_by_hand() -> None:
    """A building with two rooms, of which the second was not visited, and one without rooms."""
    seen = stack(
        [
            observe_building(
                [[4, 1], [3, 1], [0, 0]],
                hidden_share=[0.5, 0.25, 1.0],
                visited=[True, True, False],
                withheld=[1],
                unclassified=[[7], [7], [0]],
                vocabulary=("tap",),
                connected=[(1, 2)],
                surroundings=surround_rooms(
                    [12, None], [None, "kitchen"], building_kind="home", source="mp3d"
                ),
            ),
            observe_building([[9, 9]], vocabulary=("tap",)),
        ]
    )
    graph = to_graph(seen, edges=("up", "adjacent"), targets=2 * seen.inputs)
    assert graph.x.dtype == graph.y.dtype == graph.unclassified.dtype == torch.float32
    assert graph.x.tolist() == [[4, 1], [3, 1], [0, 0], [9, 9]]
    assert graph.y.tolist() == [[8, 2], [6, 2], [0, 0], [18, 18]]
    assert graph.unclassified.tolist() == [[7], [7], [0], [0]]
    assert graph.edge_index.tolist() == [[1, 1, 2, 2], [0, 2, 0, 1]]
    assert graph.is_building.tolist() == [True, False, False, True]
    assert graph.visited.tolist() == [True, True, False, True]
    assert graph.hidden_share.tolist() == [0.5, 0.25, 1.0, 0.5]
    assert graph.withheld.tolist() == [[False, True]] * 3 + [[False, False]]
    assert graph.floor_area.tolist() == [0, 12, 0, 0]
    assert graph.labels.nonzero().tolist() == [[2, list_room_labels().index("kitchen")]]
    assert graph.building_kind.tolist() == [BUILDING_KINDS.index("home")] * 3 + [-1]
    assert graph.source.tolist() == [KNOWN_SOURCES.index("mp3d")] * 3 + [-1]
    assert "y" not in to_graph(seen, edges=())


def test_stored_graphs_are_the_stored_pairs(dataset: Path) -> None:
    graphs = MaskedGraphs.stored(dataset, "train")
    cells = read_cells(dataset)
    scenes = read_splits(dataset)["train"]
    assert [(g.scene_id, g.draw) for g in graphs] == [(s, d) for s in scenes for d in range(4)]
    for graph in graphs:
        assert graph.y.numpy().tolist() == to_histograms(cells[graph.scene_id]).tolist()
        assert (graph.x <= graph.y).all()
        assert graph.is_building.tolist() == [True] + [False] * (len(graph.x) - 1)
        assert (graph.hidden_share == 0.5).all()
        assert graph.visited.all()


@pytest.mark.parametrize("edges", [("up", "adjacent"), ("complete",)])
def test_many_buildings_are_one_graph_as_pyg_batches_them(
    dataset: Path, edges: tuple[EdgeSet, ...]
) -> None:
    masked = read_split(Dataset.open(dataset), "train").take(range(7))
    graphs = MaskedGraphs(masked, edges=edges)
    (batch,) = DataLoader(graphs, batch_size=len(graphs))
    whole = to_graph(masked.seen, edges=edges, targets=masked.targets)
    seen_as = ("x", "y", "unclassified", "edge_index", "is_building", "visited", "hidden_share")
    for name in (*seen_as, "floor_area", "labels", "building_kind", "source"):
        assert torch.equal(batch[name], whole[name]), name
    assert torch.equal(batch.withheld, whole.withheld)
