"""Tables and networkx hold what the document holds."""

from __future__ import annotations

import json
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from random_beliefs import make_belief
from refusals import refuses

from bsg_models.belief import tables
from bsg_models.belief.document import to_networkx
from bsg_models.belief.tables import write_tables
from bsg_models.errors import BeliefFileError

SEED = next(seed for seed in range(99) if make_belief(seed).partial.objects)


def test_tables_hold_what_the_graphs_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "_ROWS_PER_GROUP", 40)
    beliefs = [make_belief(SEED + number, scene_id=f"s{number}") for number in range(7)]
    write_tables(iter(beliefs), tmp_path)
    nodes, edges, histograms = (
        pd.read_parquet(tmp_path / f"{name}.parquet") for name in ("nodes", "edges", "histograms")
    )
    assert pq.read_metadata(tmp_path / "nodes.parquet").num_row_groups > 1
    for belief in beliefs:
        partial, classes = belief.partial, belief.partial.class_space.classes
        mine = nodes[nodes.scene_id == partial.scene_id].set_index("node")
        rooms, objects = mine[mine.kind == "room"], mine[mine.kind == "object"]
        assert [mine.hidden_share[0], *rooms.hidden_share] == [
            partial.hidden_share,
            *(room.hidden_share for room in partial.rooms),
        ]
        assert list(rooms.id) == [room.name for room in partial.rooms]
        assert list(objects.category) == [obj.raw_category for obj in partial.objects]
        blind = mine[mine.kind == "blind"]
        assert list(blind["class"]) == [classes[node.class_index] for node in belief.blind]
        assert list(blind.presence) == [node.presence for node in belief.blind]
        links = edges[edges.scene_id == partial.scene_id]
        expects = links[links.kind == "expects"]
        assert list(expects.source) == [node.room_index for node in belief.blind]
        assert (links.kind == "adjacent").sum() == 2 * len(partial.adjacency)
        tables_of = histograms[histograms.scene_id == partial.scene_id]
        for name, expected in (
            ("input", belief.inputs),
            ("expected", belief.expected),
            ("presence", belief.presence),
        ):
            np.testing.assert_array_equal(np.stack(list(tables_of[name])), expected)
    said = json.loads(pq.read_metadata(tmp_path / "nodes.parquet").metadata[b"bsg.beliefs"])
    assert (said["model"], said["mode"]) == ("random", "complete")


def test_a_building_is_there_once_and_nothing_is_half_written(tmp_path: Path) -> None:
    with refuses(BeliefFileError, "scene-twice", tmp_path / "tables"):
        write_tables([make_belief(1), make_belief(2)], tmp_path / "tables")
    assert not (tmp_path / "tables" / "nodes.parquet").exists()


def test_networkx_has_the_nodes_and_edges_of_the_tables(tmp_path: Path) -> None:
    belief = make_belief(SEED)
    graph = to_networkx(belief)
    write_tables([belief], tmp_path)
    nodes = pd.read_parquet(tmp_path / "nodes.parquet")
    edges = pd.read_parquet(tmp_path / "edges.parquet")
    assert [kind for _, kind in graph.nodes(data="kind")] == list(nodes.kind)
    found = sorted(graph.edges(data="kind"))
    assert found == list(zip(edges.source, edges.target, edges.kind, strict=True))
    assert graph.nodes[1]["presence"] == belief.presence[1].tolist()
    assert graph.graph["class_space"]["classes"] == list(belief.partial.class_space.classes)
    assert nx.is_weakly_connected(graph)
