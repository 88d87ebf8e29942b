from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bsg_data.dataset.manifest import (
    ClassMapEntry,
    Manifest,
    SourceEntry,
    Totals,
    encode_manifest,
    read_manifest,
)
from bsg_data.dataset.scenes import Objects, make_tables
from bsg_data.dataset.schema import TABLES
from bsg_data.dataset.shards import read_scene_graphs, write_shards
from bsg_data.errors import DatasetError
from bsg_data.files import write_bytes
from bsg_data.scene.class_map import Role, load_class_map
from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject

CLASS_MAP = ClassMapEntry.of(load_class_map())
CLASS_SPACE = load_class_map().space
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
metres = st.floats(-1e3, 1e3)
points = st.tuples(metres, metres, metres)
boxes = st.builds(Box, points, points)


nothing = st.just(0)  # what stands there follows from the place in the list
rooms = st.builds(
    *(Room, nothing, nothing, st.none() | names, st.none() | points, st.none() | boxes),
    floor_index=st.none() | st.integers(0, 9),
    footprint=st.sampled_from([None, ((0.0, 1.0), (2.0, 1.0), (2.0, 3.0))]),
    label=st.none() | st.just("kitchen"),
    floor_area=st.none() | st.floats(0.1, 1e3),
)
objects = st.builds(
    *(SceneObject, nothing, nothing, st.integers(0, 3), names, st.none() | names),
    *(st.none() | st.integers(0, 44), st.sampled_from(get_args(Role))),
    *(st.none() | st.just("00FF00"), st.none() | points, st.none() | boxes),
    area=st.none(),
    part_box=st.none(),
)


@st.composite
def scene_graphs(draw: st.DrawFn, scene_id: str = "00001-aaaaaaaaaaa") -> SceneGraph:
    listed, things = draw(st.lists(rooms, max_size=3)), draw(st.lists(objects, max_size=6))
    last = len(listed)
    return SceneGraph(
        *(scene_id, "hm3d", draw(st.none() | names), draw(st.none() | st.just("train")), "0" * 64),
        rooms=tuple(replace(r, room_index=i, region_id=10 * i) for i, r in enumerate(listed, 1)),
        objects=tuple(
            thing._replace(
                object_index=i, instance_id=7 * i, room_index=min(thing.room_index, last)
            )
            for i, thing in enumerate(things, 1)
        ),
        adjacency=tuple(
            Edge(1, i, "adjacent", "layout", draw(st.none() | metres)) for i in range(2, last + 1)
        ),
        up_axis=draw(st.none() | st.just("z")),
        class_map="hm3d45-v1",
        building_kind=draw(st.none() | st.just("home")),
    )


def publish(folder: Path, graphs: list[SceneGraph]) -> None:
    manifest = Manifest(
        generator="test",
        class_space=CLASS_SPACE,
        sources=(SourceEntry(kind="hm3d", version=None, fingerprint="", class_map=CLASS_MAP),),
        scenes_per_shard=16,
        totals=Totals(),
        files=write_shards(
            make_tables(graphs, CLASS_SPACE.classes), folder, number=0, class_space=CLASS_SPACE
        ),
    )
    write_bytes(folder / "dataset.json", encode_manifest(manifest))
    assert read_manifest(folder) == manifest


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20)
@given(scene_graphs(), scene_graphs(scene_id="00002-bbbbbbbbbbb"))
def test_reading_is_the_inverse_of_writing(
    tmp_path: Path, first: SceneGraph, second: SceneGraph
) -> None:
    publish(tmp_path, [first, second])
    found = list(read_scene_graphs(tmp_path))
    assert found == [first, second]
    columns = [Objects.of(graph.objects).table for graph in (*found, first, second)]
    assert columns[:2] == columns[2:]


def test_files_carry_schema_meaning_and_classes(dataset: Path) -> None:
    for name, schema in TABLES.items():
        file = pq.ParquetFile(dataset / name / "part-00000.parquet")
        assert file.schema_arrow.equals(schema, check_metadata=False)
        words = {k.decode(): v.decode() for k, v in file.schema_arrow.metadata.items()}
        assert words["bsg.table"] == name
        assert words["bsg.class_space_sha256"] == CLASS_SPACE.sha256
        assert tuple(json.loads(words["bsg.classes"])) == CLASS_SPACE.classes
        assert file.metadata.row_group(0).column(0).compression == "ZSTD"
        for field in file.schema_arrow:
            assert field.metadata[b"meaning"]


def test_a_building_by_hand() -> None:
    box, square = Box((0, 0, 0), (2, 1, 2.5)), ((0, 0), (2, 0), (2, 1), (0, 1))
    lamp = SceneObject(1, 5, 1, "Lamp", "lamp", 31, "classified", part_box=box)
    graph = SceneGraph(
        *("00001-a", "hm3d", None, None, "0" * 64),
        rooms=(Room(1, 0, "hall", box=box, footprint=square), Room(2, 7)),
        objects=(lamp, SceneObject(2, 9, 0, "zzqx"), SceneObject(3, 10, 0, "zzqx")),
        adjacency=(Edge(1, 2, "adjacent", "door", None),),
        class_map="hm3d45-v1",
    )
    made = make_tables([graph], CLASS_SPACE.classes)
    tables = {name: made[name].to_pydict() for name in TABLES}
    assert tables["scenes"]["num_classified"] == [1]
    assert tables["scenes"]["has_geometry"] == [True]
    assert tables["rooms"]["footprint"] == [[0, 0, 2, 0, 2, 1, 0, 1], None]
    assert tables["objects"]["class"] == [CLASS_SPACE.classes[31], None, None]
    assert tables["objects"]["part_max_z"] == [2.5, None, None]
    ends = ("source_kind", "source_index", "target_kind", "target_index", "kind", "method")
    assert list(zip(*(tables["edges"][name] for name in ends), strict=True)) == [
        ("building", 0, "room", 1, "contains", "annotation"),
        ("building", 0, "room", 2, "contains", "annotation"),
        ("room", 1, "object", 1, "contains", "annotation"),
        *(("building", 0, "object", n, "contains", "annotation") for n in (2, 3)),
        ("room", 1, "room", 2, "adjacent", "door"),
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"format_version": 1', '"format_version": 99', "found 99; a newer program .* upgrade"),
        ('"totals"', '"total"', "is damaged"),
        ("{", "", "not JSON"),
    ],
)
def test_a_manifest_changed_by_hand_is_refused(
    dataset: Path, old: str, new: str, message: str
) -> None:
    path = dataset / "dataset.json"
    path.write_text(path.read_text("utf-8").replace(old, new, 1), "utf-8")
    with pytest.raises(DatasetError, match=message):
        read_manifest(dataset)
    path.unlink()
    with pytest.raises(DatasetError, match="is no finished dataset"):
        list(read_scene_graphs(dataset))
