"""Painted meshes: the reader finds what is true of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import Manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.hm3d import HM3DFolder
from painted_meshes import write_painted


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("places") / "buildings"
    write_painted(folder, scenes=3, seed=5)
    return folder


@pytest.fixture(scope="module")
def built(places: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Manifest]:
    out = tmp_path_factory.mktemp("built") / "dataset"
    return out, build_dataset(HM3DFolder(places), out)


def truth_of(folder: Path, scene_id: str) -> dict[str, Any]:
    (path,) = folder.glob(f"*/{scene_id}/*.truth.json")
    found: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return found


def test_boxes_areas_and_centroids_are_the_truth(
    places: Path, built: tuple[Path, Manifest]
) -> None:
    judged = 0
    for graph in read_scene_graphs(built[0]):
        truth = truth_of(places, graph.scene_id)
        assert graph.up_axis == truth["up_axis"]
        for obj in graph.objects:
            true = truth["instances"].get(str(obj.instance_id))
            assert (obj.box is None) == (true is None), obj
            if true is None or true["texels"] <= 100:
                continue
            assert obj.box is not None
            assert obj.area is not None
            found = [obj.box.minimum, obj.box.maximum]
            np.testing.assert_allclose(found, true["box"], atol=0.02)
            np.testing.assert_allclose(obj.centroid or (), true["centroid"], atol=0.05)
            assert obj.area == pytest.approx(true["area"], rel=0.1)
            judged += 1
    assert judged > 1000


def test_what_is_painted_astray_is_in_the_box_and_not_in_the_part(
    places: Path, built: tuple[Path, Manifest]
) -> None:
    specks = 0
    for graph in read_scene_graphs(built[0]):
        truth = truth_of(places, graph.scene_id)["instances"]
        for obj in graph.objects:
            true = truth.get(str(obj.instance_id))
            if true and true["main_box"] and true["main_box"] != true["box"]:
                assert obj.part_box is not None
                part = [obj.part_box.minimum, obj.part_box.maximum]
                np.testing.assert_allclose(part, true["main_box"], atol=0.02)
                specks += 1
    assert specks > 0


def test_coverage_adds_up(built: tuple[Path, Manifest]) -> None:
    assert len(built[1].meshes) == 3
    for mesh in built[1].meshes.values():
        assert mesh.texels == mesh.listed + mesh.snapped + mesh.black + mesh.unlisted
        areas = mesh.listed_area + mesh.unlisted_area + mesh.uncoloured_area
        assert areas == pytest.approx(mesh.area, abs=0.01)
        assert mesh.unlisted_colours > 0
        assert mesh.without_geometry > 0
    assert check_dataset(built[0]) == ()


def true_pairs(graph: SceneGraph, truth: dict[str, Any]) -> set[tuple[int, int]]:
    index = {room.region_id: room.room_index for room in graph.rooms}
    pairs = ((index[a], index[b]) for a, b, _ in truth["connections"])
    return {(min(pair), max(pair)) for pair in pairs}


def test_most_connections_are_found(places: Path, built: tuple[Path, Manifest]) -> None:
    right = found = true = 0
    for graph in read_scene_graphs(built[0]):
        pairs = true_pairs(graph, truth_of(places, graph.scene_id))
        edges = {(edge.source, edge.target) for edge in graph.adjacency}
        right, found, true = right + len(pairs & edges), found + len(edges), true + len(pairs)
    assert 2 * right / (found + true) == pytest.approx(0.953, abs=0.001)  # docs/geometry.md
