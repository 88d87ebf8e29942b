"""Painted meshes: the reader finds what is true of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.scene.scene_graph import Box, SceneGraph
from bsg_data.sources.hm3d import HM3DFolder
from painted_meshes import write_painted


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("painted")
    write_painted(folder / "buildings", scenes=3, seed=5)
    build_dataset(HM3DFolder(folder / "buildings"), folder / "dataset")
    return folder


@pytest.fixture(scope="module")
def judged(built: Path) -> list[tuple[SceneGraph, dict[str, Any]]]:
    """The graphs that were built, each with the truth."""
    graphs = read_scene_graphs(built / "dataset")
    truths = {one.name.split(".")[0]: one for one in built.rglob("*.truth.json")}
    return [(g, json.loads(truths[g.scene_id.split("-")[1]].read_text("utf-8"))) for g in graphs]


def assert_close(found: Box | None, true: list[list[float]]) -> None:
    """A triangle of several colours is cut into pieces of 5 cm, each of one."""
    assert found is not None
    np.testing.assert_allclose([found.minimum, found.maximum], true, atol=0.04)


def test_instances_are_where_they_are_painted(
    judged: list[tuple[SceneGraph, dict[str, Any]]],
) -> None:
    specks = large = 0
    for graph, truth in judged:
        assert graph.up_axis == truth["up_axis"]
        for obj in graph.objects:
            true = truth["instances"].get(str(obj.instance_id))
            assert (obj.box is None) <= (true is None or true["area"] < 0.04), obj
            if true is None or true["area"] < 0.04:
                continue
            large += 1
            assert_close(obj.box, true["box"])
            np.testing.assert_allclose(obj.centroid or (), true["centroid"], atol=0.03)
            assert obj.area == pytest.approx(true["area"], rel=0.1, abs=0.01)  # four pieces
            if true["part"] not in (None, true["box"]):
                assert_close(obj.part_box, true["part"])
                specks += 1
    assert large > 1000
    assert specks > 3, specks


def test_coverage_adds_up(built: Path) -> None:
    manifest = json.loads((built / "dataset" / "dataset.json").read_text("utf-8"))
    for mesh in manifest["meshes"].values():
        parts = (mesh["listed"], mesh["snapped"], mesh["black"], mesh["unlisted"])
        assert mesh["texels"] == sum(parts)
        areas = mesh["listed_area"] + mesh["unlisted_area"] + mesh["uncoloured_area"]
        assert areas == pytest.approx(mesh["area"], abs=0.01)
        assert mesh["unlisted_colours"] > 0
        assert mesh["without_geometry"] > 0
    assert check_dataset(built / "dataset") == ()


def test_most_connections_are_found(judged: list[tuple[SceneGraph, dict[str, Any]]]) -> None:
    right = found = true = 0
    for graph, truth in judged:
        index = {room.region_id: room.room_index for room in graph.rooms}
        pairs = {tuple(sorted((index[a], index[b]))) for a, b, _ in truth["connections"]}
        edges = {(edge.source, edge.target) for edge in graph.adjacency}
        right, found, true = right + len(pairs & edges), found + len(edges), true + len(pairs)
    assert 2 * right / (found + true) == pytest.approx(0.952, abs=0.001)  # docs/geometry.md
