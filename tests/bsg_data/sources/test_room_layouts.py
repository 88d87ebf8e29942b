"""Room layouts of three kinds: by hand, every malformed one, and exported ones that come back."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import SourceError
from bsg_data.exports.habitat import ROW
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.scene_graph import Box, Edge, SceneGraph
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, Source
from bsg_data.synthetic.buildings import write_synthetic

SHARED = REPOSITORY.parent / "shared"
CASE = SHARED / "cases" / "12-hm3d-room-labels"
SCENE = "00001-abcdefghi01"  # with the regions 0, 3 and 10
LAYOUT = """\
rooms:
  room_1:
    label: kitchen
    centroid: {x: 1.0, y: 1.25, z: -2.0}
    dims: {x: 2.0, y: 2.5, z: 4.0}
  room_2:
    label: hallway
    centroid: {x: 4.0, y: 4.25, z: -2.0}
    dims: {x: 2.0, y: 2.5, z: 1.0}
connections:
- [1, 2]
- [2, 1]
"""


def read_one(source: Source, scene_id: str = SCENE) -> tuple[SceneGraph, list[str]]:
    """Return a scene graph, and why what belongs to it was left out."""
    (ref,) = (ref for ref in source.find().scenes if ref.scene_id == scene_id)
    reading = source.read(ref, load_class_map())
    return reading.graph, [skip.reason for skip in reading.left_out]


def labels_of(graph: SceneGraph) -> list[str | None]:
    return [room.label for room in graph.rooms]


def reasons_of(found: FoundScenes) -> list[tuple[str, str, str]]:
    return [(skip.scene_id, skip.location, skip.reason) for skip in found.unused]


@pytest.fixture
def layouts(hm3d_folder: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "layouts"
    folder.mkdir()
    (folder / "00001-abcdefghi01.yaml").write_text(LAYOUT)
    return folder


def test_a_layout_joins_its_scene(hm3d_folder: Path, layouts: Path, tmp_path: Path) -> None:
    source = WithLayouts(HM3DFolder(hm3d_folder), layouts)
    manifest = build_dataset(source, tmp_path / "out", scenes_per_shard=3)
    assert (manifest.totals.placed, manifest.totals.adjacent) == (1, 1)
    assert manifest.sources[0].options["room_layouts"] == 1
    assert check_dataset(tmp_path / "out") == ()
    graph = next(g for g in read_scene_graphs(tmp_path / "out") if g.has_geometry)
    assert (graph.scene_id, graph.up_axis) == (SCENE, None)
    assert [(room.source_label, room.floor_index) for room in graph.rooms] == [
        ("kitchen", 0),
        ("hallway", 1),
        (None, None),
    ]
    # Y up with z to the back became Z up with y to the front.
    assert graph.rooms[0].box == Box((0, 0, 0), (2, 4, 2.5))
    assert graph.rooms[0].footprint == ((0, 0), (2, 0), (2, 4), (0, 4))
    assert graph.adjacency == (Edge(1, 2, "adjacent", "layout", pytest.approx(18**0.5)),)


def region_of(**changes: Any) -> dict[str, Any]:
    return {
        "name": "region_3",
        "label": "bathroom",
        "poly_loop": [[0, 1, 0], [4, 1, 0], [4, 1, -3], [2, 1, -3], [2, 1, -1], [0, 1, -1]],
        "floor_height": 1,
        "extrusion_height": 2,
        "min_bounds": [0, 1, -3],
        "max_bounds": [4, 3, 0],
        **changes,
    }


def regions(*listed: dict[str, Any]) -> str:
    return json.dumps({"region_annotations": listed})


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rooms: [", "expected YAML"),
        (LAYOUT.replace("x: 1.0", "x: .nan"), "rooms.room_1.centroid.x"),
        (LAYOUT.replace("y: 2.5", "y: -2.5", 1), "rooms.room_1.dims.y"),
        (LAYOUT.replace("room_2", "cellar"), "rooms.cellar"),
        (LAYOUT.replace("[2, 1]", "[2, 7]"), "found 2 and 7"),
        (LAYOUT.replace("room_2", "room_99").replace("2]", "99]").replace("[2", "[99"), "room_99"),
        (LAYOUT.replace("room_2", "room_1", 1), "the key 'room_1' twice"),
        (LAYOUT.replace("[2, 1]", "[2, 2]"), "found 2 and 2"),
        ("rooms: {room_2: {centroid: {x: 1, y: 1, z: 1}}}", "room_2: has half a box: centroid"),
        ("rooms: {room_2: {label: hall, dims: {x: 1, y: 1, z: 1}}}", "half a box: dims without"),
        ("rooms: {room_2: {}}", "rooms.room_2: expected a label, or centroid and dims"),
        (regions(region_of(name="gym")), "region_annotations.0.name: String should match pattern"),
        (regions(region_of(min_bounds=None)), "region_annotations.0: has half a box: max_bounds"),
        (regions(region_of(max_bounds=[4, 0, 0])), "max_bounds.y: expected 1.0 or more, found 0.0"),
        (regions(region_of(poly_loop=[[0, 0, 0]] * 2)), "region_annotations.0.poly_loop"),
        (regions(region_of(name="region_1")), "region 1 is no region id of the 3 rooms"),
        (regions(region_of(), region_of(label="hall")), "region_3 is there twice"),
    ],
)
def test_a_malformed_layout_is_left_out_with_the_reason(
    hm3d_folder: Path, tmp_path: Path, text: str, expected: str
) -> None:
    suffix = ".semantic_config.json" if text.startswith("{") else ".yaml"
    path = tmp_path / f"{SCENE}{suffix}"
    path.write_text(text)
    graph, (reason,) = read_one(WithLayouts(HM3DFolder(hm3d_folder), path))
    assert (len(graph.rooms), labels_of(graph)) == (3, [None] * 3)
    assert expected in reason
    assert str(tmp_path) not in reason


def test_layouts_of_no_scene_are_reported(hm3d_folder: Path, layouts: Path, tmp_path: Path) -> None:
    mine, other = layouts / f"{SCENE}.yaml", layouts / "00777-zzzzzzzzzzz.yaml"
    other.write_text(LAYOUT)
    source = WithLayouts(HM3DFolder(hm3d_folder), layouts)
    before, manifest = source.find(), build_dataset(source, tmp_path / "out")
    assert [skip.location for skip in manifest.left_out] == [other.name]
    mine.write_text(LAYOUT.replace("kitchen", "cellar"))
    other.rename(layouts / "00002-abcdefghi02.yaml")
    after = source.find()  # which lists the layouts anew
    assert after.scenes != before.scenes, "a resumed build sees that a layout changed"
    assert (len(before.unused), after.unused) == (1, ())
    (layouts / "00002-abcdefghi02.yaml").unlink()
    mine.rename(other)
    with refuses(SourceError, "layouts-foreign", layouts):
        source.find()
    other.unlink()
    for path, code in ((layouts, "source-empty"), (tmp_path / "none", "source-missing")):
        with refuses(SourceError, code, path):
            WithLayouts(HM3DFolder(hm3d_folder), path).find()


class Placed(HM3DFolder):
    """Annotations that a mesh placed."""

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Return a building whose last two rooms connect."""
        reading = super().read(ref, class_map)
        rooms = tuple(replace(room, box=Box((0, 0, 0), (1, 1, 1))) for room in reading.graph.rooms)
        door = Edge(2, 3, "adjacent", "door")
        graph = replace(reading.graph, up_axis="z", rooms=rooms, adjacency=(door,))
        return replace(reading, graph=graph)


def test_a_building_that_a_mesh_placed_takes_labels_and_connections_alone(
    hm3d_folder: Path, layouts: Path
) -> None:
    alone, _ = read_one(Placed(hm3d_folder))
    found, _ = read_one(WithLayouts(Placed(hm3d_folder), layouts))
    assert [room.box for room in found.rooms] == [room.box for room in alone.rooms]
    assert [room.source_label for room in found.rooms] == ["kitchen", "hallway", None]
    # A room that the layout lacks keeps what the mesh gave it.
    methods = {(edge.source, edge.target): edge.method for edge in found.adjacency}
    assert methods == {(1, 2): "layout", (2, 3): "door"}


def test_labels_alone_leave_levels_terms_and_connections_as_the_source_says(tmp_path: Path) -> None:
    box = "box_min_x,box_min_y,box_min_z,box_max_x,box_max_y,box_max_z"
    rows = ["a,1,stove,0,2,0,0,0,1,1,1", "a,2,bed,3,,0,0,0,1,1,1"]  # one height, two levels
    text = "\n".join([f"scene,room,category,floor,connected,{box}", *rows])
    (tmp_path / "o.csv").write_text(text)
    path, yaml = (
        tmp_path / "a.yaml",
        "rooms: {room_1: {label: kitchen}, room_2: {label: bedroom}}",
    )
    path.write_text(yaml)
    terms = {"licence": "CC-BY-4.0", "homepage": "https://example.org", "citation": "Doe"}
    own = open_source("table", tmp_path / "o.csv", **terms)
    source = WithLayouts(own, path)
    graph, _ = read_one(source, "a")
    assert [(room.label, room.floor_index) for room in graph.rooms] == [
        ("kitchen", 0),
        ("bedroom", 1),
    ]
    assert [edge.method for edge in graph.adjacency] == ["given"]
    assert source.terms == getattr(own, "terms", None)
    assert source.terms is not None
    path.write_text(f"{yaml}\nconnections: []")
    assert read_one(source, "a")[0].adjacency == (), "a layout may say that none connect"


TABLE = f"""\
scene,region,label
{SCENE},3,bathroom
{SCENE},0,kitchen
{SCENE},10,
abcdefghi02,11.0,Bedroom 2
00777-zzzzzzzzzzz,4,bedroom
00777-zzzzzzzzzzz,5,attic
"""


def test_a_table_names_rooms_by_region_id(hm3d_folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    path.write_text(TABLE)
    source = WithLayouts(HM3DFolder(hm3d_folder), path)
    assert labels_of(read_one(source)[0]) == ["kitchen", "bathroom", None]
    graph, _ = read_one(source, "00002-abcdefghi02")  # by the key of the building
    assert [(room.region_id, room.label) for room in graph.rooms][-1] == (11, "bedroom")
    assert graph.rooms[-1].source_label == "Bedroom 2"
    assert reasons_of(source.find()) == [
        ("00777-zzzzzzzzzzz", "labels.csv", "2 room labels of no scene of the source")
    ]


HALF = f"{SCENE},0,kitchen\n"
FOREIGN = (
    f"region 1 is no region id of the 3 rooms of {SCENE} (0, 3, 10); the layout (2 rooms) is of "
    "another scene or another version"
)
NULL = "a label of the null region, which is no room"


@pytest.mark.parametrize(
    ("text", "labels", "left", "unused"),
    [
        (f"scene,region,label\n{HALF}{SCENE},1,bath\n", None, [FOREIGN], []),
        (f"scene,region,label\n{HALF}{SCENE},-1,garden\n", "kitchen", [NULL], []),
        (f"Scene Name,Region #,Region Category\n\n{HALF}", "kitchen", [], []),
        (f"\ufeffscene\tregion\tlabel\n{SCENE}\t0\t Kitchen\n", "kitchen", [], []),
        (
            f"Scene Name,Region #,Room Proposal,votes\n{SCENE},0,kitchen,7\n",
            "kitchen",
            [],
            ["columns that are not read: votes"],
        ),
    ],
)
def test_what_is_read_of_a_table_and_what_is_not(
    hm3d_folder: Path,
    tmp_path: Path,
    text: str,
    labels: str | None,
    left: list[str],
    unused: list[str],
) -> None:
    path = tmp_path / ("labels.TSV" if "\t" in text else "labels.csv")
    path.write_text(text, "utf-8")
    source = WithLayouts(HM3DFolder(hm3d_folder), path)
    graph, left_out = read_one(source)
    assert (labels_of(graph), left_out) == ([labels, None, None], left)
    assert reasons_of(source.find()) == [("all", path.name, why) for why in unused]


@pytest.mark.parametrize(
    ("code", "text"),
    [
        ("rows-disagree", f"scene,region,label\n{SCENE},3,bath\n\n{SCENE},3.0,hall\n"),
        ("row-malformed", f"scene,region,label\n{SCENE},first,bath\n"),
        ("row-malformed", "scene,region,label\n,1,bath\n"),
        ("column-missing", f"scene;region;label\n{SCENE};1;bath\n"),
        ("column-missing", f"scene,regions,label\n{SCENE},1,bath\n"),
        ("column-twice", "scene,region,label,label\n"),
        ("layouts-foreign", "scene,region,label\nb,1,kitchen\n"),
    ],
)
def test_a_malformed_table_is_refused_with_its_line(
    hm3d_folder: Path, tmp_path: Path, code: str, text: str
) -> None:
    path = tmp_path / "labels.csv"
    path.write_text(text)
    line = {"rows-disagree": ", line 4", "row-malformed": ", line 2"}.get(code, "")
    with refuses(SourceError, code, f"{path}{line}"):
        WithLayouts(HM3DFolder(hm3d_folder), path).find()


def test_habitat_s_file_gives_label_box_footprint_and_area(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    path = tmp_path / "habitat" / SCENE / "abcdefghi01.semantic_config.json"  # as HM3D's folders
    path.parent.mkdir(parents=True)
    path.write_text(regions(region_of(), {"name": "region_0", "label": "room"}))
    source = WithLayouts(HM3DFolder(hm3d_folder), tmp_path / "habitat")
    graph, left_out = read_one(source)
    assert (labels_of(graph), left_out) == ([None, "bathroom", None], [])
    first, room, _ = graph.rooms
    assert (first.box, first.source_label) == (None, None)
    assert room.box == Box((0, 0, 1), (4, 3, 3))
    # An L of 4 m x 1 m and 2 m x 2 m, and its convex hull.
    assert room.floor_area == 8
    assert room.footprint is not None
    assert set(room.footprint) == {(0, 0), (4, 0), (4, 3), (2, 3), (0, 1)}
    assert (room.floor_z, room.floor_index) == (1, 0)


def test_what_is_exported_for_habitat_comes_back_onto_a_build_without_it(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "places", scenes=2, seed=3))
    plain, back = HM3DFolder(tmp_path / "places"), tmp_path / "back"
    placed = WithLayouts(plain, tmp_path / "places" / "layouts")
    scenes = [ref.scene_id for ref in plain.find().scenes]
    graphs = {scene: read_one(placed, scene)[0] for scene in scenes}
    back.mkdir()
    for graph in graphs.values():
        for name, data in ROW.encode(graph, ()).files.items():
            (back / name).write_bytes(data)
    for scene, graph in graphs.items():
        found, left_out = read_one(WithLayouts(plain, back), scene)
        assert (labels_of(found), left_out) == (labels_of(graph), [])
        for ours, theirs in zip(found.rooms, graph.rooms, strict=True):
            assert ours.region_id == theirs.region_id
            corners = (sorted(np.round(one.footprint, 6).tolist()) for one in (ours, theirs))
            assert next(corners) == next(corners)
            assert ours.floor_area == theirs.floor_area
            boxes = [(*box.minimum, *box.maximum) for box in (ours.box, theirs.box)]
            assert boxes[0] == pytest.approx(boxes[1], abs=1e-6)


def test_of_two_layouts_of_one_scene_one_is_taken_and_the_other_said(
    hm3d_folder: Path, layouts: Path
) -> None:
    (layouts / "old").mkdir()
    (layouts / "old" / f"{SCENE}.yaml").write_text(LAYOUT.replace("kitchen", "office"))
    (layouts / "abcdefghi01.yml").write_text(LAYOUT.replace("kitchen", "garage"))
    source = WithLayouts(HM3DFolder(hm3d_folder), layouts)
    assert labels_of(read_one(source)[0])[0] == "kitchen"
    why = "a room layout of a scene that has another layout"
    assert reasons_of(source.find()) == [
        ("abcdefghi01", "abcdefghi01.yml", why),
        (SCENE, f"old/{SCENE}.yaml", why),
    ]


@pytest.mark.skipif(not CASE.is_dir(), reason="no case here")
@pytest.mark.parametrize("layouts", ["layouts", "labels.csv"])
def test_the_labels_of_a_user_s_hm3d(layouts: str) -> None:
    source = WithLayouts(HM3DFolder(CASE / "train"), CASE / layouts)
    graph, left_out = read_one(source, "00001-AbCdEfGhIjK")
    assert (labels_of(graph), left_out) == (["bedroom", "kitchen"], [])
    assert not graph.has_geometry
