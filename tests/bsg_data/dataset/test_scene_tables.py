"""Scene graphs as tables: a building by hand, and everything that a record can hold, and back."""

from __future__ import annotations

import pyarrow as pa

from bsg_data.dataset.scene_tables import assemble_graphs, collect_columns
from bsg_data.dataset.schema import TABLES
from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject

CLASSES = ("chair", "lamp")
_ENDS = ("source_kind", "source_index", "target_kind", "target_index", "kind")
BOX = Box((0.0, 0.0, 0.0), (2.0, 1.0, 2.5))
SQUARE = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0))
FULL = SceneGraph(
    scene_id="00001-a",
    source="hm3d",
    source_version="v0.2",
    source_split="train",
    annotation_sha256="0" * 64,
    rooms=(Room(1, 0, "hall", (1.0, 0.5, 1.25), BOX, 0, 0.1, SQUARE), Room(2, 7)),
    objects=(
        SceneObject(
            1, 5, 1, "Lamp", "lamp", 1, "classified", "00FF00", (1.0, 0.5, 1.0), BOX, 1.5, BOX
        ),
        SceneObject(2, 9, 0, "zzqx", None, None, "unmapped"),
    ),
    adjacency=(Edge(1, 2, "adjacent", "door", None),),
    up_axis="y",
    class_map="hm3d45-v1",
)
BARE = SceneGraph("00002-b", "hm3d", None, None, "1" * 64, (), (), class_map="hm3d45-v1")


def test_a_building_by_hand() -> None:
    columns = collect_columns([FULL], classes=CLASSES)
    assert columns["scenes"]["num_classified"] == [1]
    assert columns["scenes"]["has_geometry"] == [True]
    assert columns["rooms"]["footprint"] == [[0.0, 0.0, 2.0, 0.0, 2.0, 1.0, 0.0, 1.0], None]
    assert columns["objects"]["class"] == ["lamp", None]
    assert columns["objects"]["part_max_z"] == [2.5, None]
    edges = columns["edges"]
    assert list(zip(*(edges[name] for name in _ENDS), strict=True)) == [
        ("building", 0, "room", 1, "contains"),
        ("building", 0, "room", 2, "contains"),
        ("room", 1, "object", 1, "contains"),
        ("building", 0, "object", 2, "contains"),
        ("room", 1, "room", 2, "adjacent"),
    ]


def test_assembling_is_the_inverse_of_collecting() -> None:
    columns = collect_columns([FULL, BARE], classes=CLASSES)
    tables = {
        name: pa.Table.from_pydict(columns[name], schema=schema) for name, schema in TABLES.items()
    }
    assert list(assemble_graphs(tables)) == [FULL, BARE]
