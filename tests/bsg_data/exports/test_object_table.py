"""Tables that were written are read back as the same buildings, but for numbers and colours."""

from __future__ import annotations

from pathlib import Path

from contracts import make_graphs

from bsg_data.dataset.dataset import Dataset
from bsg_data.exports.export import export_dataset
from bsg_data.exports.object_table import ROW
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.catalogue import open_source


def say(graph: SceneGraph) -> tuple[object, ...]:
    """Return what a table holds of a building, in an order of its own."""
    rooms = [(r.region_id, r.label, r.floor_index, r.floor_area) for r in graph.rooms]
    objects = [
        (o.room_index, o.raw_category or "unknown", o.centroid, o.box) for o in graph.objects
    ]
    links = [(edge.source, edge.target) for edge in graph.adjacency]
    return graph.scene_id, rooms, sorted(objects, key=repr), links


def read_back(path: Path) -> list[tuple[object, ...]]:
    source = open_source("table", path)
    return [say(source.read(ref, load_class_map()).graph) for ref in source.find().scenes]


def test_a_placed_building_comes_back(tmp_path: Path) -> None:
    graph = next(make_graphs())
    (data,) = ROW.encode(graph, ()).files.values()
    (tmp_path / "t.csv").write_bytes(data)
    assert read_back(tmp_path / "t.csv") == [say(graph)]


def test_joined_tables_of_a_dataset_come_back(tmp_path: Path, dataset: Path) -> None:
    export_dataset(dataset, tmp_path / "out", to="table")
    joined = b"".join(path.read_bytes() for path in sorted((tmp_path / "out").iterdir()))
    (tmp_path / "t.csv").write_bytes(joined)
    assert read_back(tmp_path / "t.csv") == [
        say(graph) for graph in Dataset.open(dataset).read_graphs()
    ]
