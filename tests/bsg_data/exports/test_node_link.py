"""Buildings as networkx's node-link JSON: by hand, and as networkx reads and writes it."""

from __future__ import annotations

import json
from collections import Counter
from operator import itemgetter
from pathlib import Path

import networkx as nx
from whole_home import CLASSES, HOME

from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.exports.export import export_dataset
from bsg_data.exports.node_link import encode_node_link


def test_a_building_by_hand() -> None:
    encoded = encode_node_link(HOME, CLASSES)
    assert (encoded.rooms, encoded.objects, encoded.note) == (2, 3, None)
    document = json.loads(encoded.files["home 1.node-link.json"])
    building, kitchen, other, chair, loose, clock = document.pop("nodes")
    edges = [tuple(edge.values()) for edge in document.pop("edges")]
    assert document == {"directed": True, "multigraph": False, "graph": {}}
    assert (building["kind"], building["num_objects"]) == ("building", 3)
    assert "source_split" not in building, "what is null is absent"
    shared = {"kind": "room", "scene_id": "home 1"}
    assert other == {"id": 2, **shared, "room_index": 2, "region_id": 9}
    assert kitchen == {
        "id": 1,
        **shared,
        "room_index": 1,
        "region_id": 4,
        "label": "kitchen",
        "source_label": "Küche",
        "centroid_x": 1,
        "centroid_y": 2,
        "centroid_z": 1.5,
        "floor_index": 0,
        "footprint": [0, 0, 4, 0, 4, 3],
    }
    assert (chair["class"], chair["class_index"], chair["box_max_z"]) == ("chair", 1, 3)
    assert (clock["category"], clock["area"], clock.get("class")) == ("clock", 0.5, None)
    assert loose == {
        "id": 4,
        "kind": "object",
        "scene_id": "home 1",
        "object_index": 2,
        "instance_id": 8,
        "room_index": 0,
        "raw_category": "",
        "role": "unmapped",
        "has_geometry": False,
    }
    assert edges == [
        (0, 1, "contains", "annotation"),
        (0, 2, "contains", "annotation"),
        (2, 3, "contains", "annotation"),
        (0, 4, "contains", "annotation"),
        (2, 5, "contains", "annotation"),
        (1, 2, "adjacent", "door", 3.5),
        (2, 1, "adjacent", "door", 3.5),
    ]


def test_networkx_reads_all_that_the_tables_hold_and_writes_it_again(
    dataset: Path, tmp_path: Path
) -> None:
    done = export_dataset(dataset, tmp_path / "out", to="networkx")
    graphs = list(read_scene_graphs(dataset))
    for scene in graphs:
        document = json.loads((tmp_path / "out" / f"{scene.scene_id}.node-link.json").read_text())
        graph = nx.node_link_graph(document, edges="edges")
        again = nx.node_link_data(graph, edges="edges")
        for one in (again, document):
            one["edges"].sort(key=itemgetter("source", "target"))
        assert again == document
        assert nx.descendants(graph, 0) == set(graph) - {0}
        assert Counter(kind for _, kind in graph.nodes(data="kind")) == Counter(
            building=1, room=len(scene.rooms), object=len(scene.objects)
        )
    assert (done.files, done.scenes, done.left_out, done.rooms_left_out) == (12, 12, (), 0)
    assert done.rooms == sum(len(scene.rooms) for scene in graphs)
    assert done.objects == sum(len(scene.objects) for scene in graphs)
