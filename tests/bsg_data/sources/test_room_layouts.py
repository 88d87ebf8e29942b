"""Room layouts: one by hand, every malformed one, and real ones joined to their scenes."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HEADER, MEMBER, HM3DStatistics
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.synthetic.buildings import GeometryOptions, write_synthetic

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
    graph = next(g for g in read_scene_graphs(tmp_path / "out") if g.has_geometry)
    assert graph.scene_id == "00001-abcdefghi01"
    first, second, third = graph.rooms  # regions 0, 3 and 10
    assert (first.source_label, second.source_label, third.source_label) == (
        "kitchen",
        "hallway",
        None,
    )
    assert (first.floor_index, second.floor_index, third.floor_index) == (0, 1, None)
    # Y up with z to the back became Z up with y to the front.
    assert first.box == Box((0, 0, 0), (2, 4, 2.5))
    assert first.footprint == ((0, 0), (2, 0), (2, 4), (0, 4))
    (edge,) = graph.adjacency
    assert (edge.source, edge.target, edge.method) == (1, 2, "layout")
    assert edge.distance_m == pytest.approx((9 + 9) ** 0.5)
    assert graph.up_axis is None
    assert check_dataset(tmp_path / "out") == ()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rooms: [", "no YAML"),
        (LAYOUT.replace("x: 1.0", "x: .nan"), "rooms.room_1.centroid.x"),
        (LAYOUT.replace("y: 2.5", "y: -2.5", 1), "rooms.room_1.dims.y"),
        (LAYOUT.replace("room_2", "cellar"), "rooms.cellar"),
        (LAYOUT.replace("[2, 1]", "[2, 7]"), "found 2 and 7"),
        (LAYOUT.replace("room_2", "room_99").replace("2]", "99]").replace("[2", "[99"), "room_99"),
        (LAYOUT.replace("room_2", "room_1", 1), "the key 'room_1' twice"),
        (LAYOUT.replace("x: 2.0", "x: 1.7e308", 1), "rooms.room_1.dims.x"),
        (LAYOUT.replace("[2, 1]", "[2, 2]"), "found 2 and 2"),
    ],
)
def test_a_malformed_layout_is_left_out_with_the_reason(
    hm3d_folder: Path, layouts: Path, tmp_path: Path, text: str, expected: str
) -> None:
    (layouts / "00001-abcdefghi01.yaml").write_text(text)
    source = WithLayouts(HM3DFolder(hm3d_folder), layouts)
    manifest = build_dataset(source, tmp_path / "out")
    (skip,) = manifest.left_out
    assert skip.scene_id == "00001-abcdefghi01"
    assert skip.location == "00001-abcdefghi01.yaml"
    assert expected in skip.reason
    assert str(tmp_path) not in skip.reason
    assert manifest.totals.scenes == 12  # the scene is kept
    with pytest.raises(SourceError):
        build_dataset(source, tmp_path / "strict", strict=True)


def test_layouts_of_no_scene_are_reported(hm3d_folder: Path, layouts: Path, tmp_path: Path) -> None:
    (layouts / "00777-zzzzzzzzzzz.yaml").write_text(LAYOUT)
    manifest = build_dataset(WithLayouts(HM3DFolder(hm3d_folder), layouts), tmp_path / "out")
    assert [skip.location for skip in manifest.left_out] == ["00777-zzzzzzzzzzz.yaml"]
    (layouts / "00001-abcdefghi01.yaml").write_text(LAYOUT.replace("kitchen", "cellar"))
    again = build_dataset(WithLayouts(HM3DFolder(hm3d_folder), layouts), tmp_path / "again")
    assert again.sources[0].fingerprint != manifest.sources[0].fingerprint
    (layouts / "00001-abcdefghi01.yaml").unlink()
    with refuses(SourceError, "layouts-foreign", layouts):
        WithLayouts(HM3DFolder(hm3d_folder), layouts).find()
    with refuses(SourceError, "source-missing", tmp_path / "none"):
        WithLayouts(HM3DFolder(hm3d_folder), tmp_path / "none").find()


def test_a_building_that_a_mesh_placed_takes_labels_and_connections_alone(tmp_path: Path) -> None:
    places, folder = tmp_path / "places", tmp_path / "layouts"
    (path,) = write_synthetic(places, scenes=1, seed=0, geometry=GeometryOptions())
    folder.mkdir()
    (folder / f"{path.parent.name}.yaml").write_text(LAYOUT)
    mesh, both = HM3DFolder(places), WithLayouts(HM3DFolder(places), folder)
    class_map = load_class_map()
    alone = mesh.read(mesh.find().scenes[0], class_map).graph
    found = both.read(both.find().scenes[0], class_map).graph
    assert [room.box for room in found.rooms] == [room.box for room in alone.rooms]
    assert [room.source_label for room in found.rooms[:3]] == ["kitchen", "hallway", None]
    layout = [edge for edge in found.adjacency if edge.method == "layout"]
    assert [(edge.source, edge.target) for edge in layout] == [(1, 2)]
    # Rooms that the layout lacks keep what the mesh gave them.
    rest = [edge for edge in alone.adjacency if edge.target > 2]
    assert rest
    assert [edge for edge in found.adjacency if edge.method != "layout"] == rest


def test_a_scene_id_does_not_lead_out_of_the_folder_of_layouts(tmp_path: Path) -> None:
    (tmp_path / "secret.yaml").write_text(LAYOUT)
    (tmp_path / "layouts").mkdir()
    (tmp_path / "layouts" / "00006-aaaaaaaaaaa.yaml").write_text(LAYOUT)
    rows = [
        f"{scene},{k},1,1,chair_{k}" for scene in ("../secret", "00006-aaaaaaaaaaa") for k in (1, 2)
    ]
    with zipfile.ZipFile(tmp_path / "s.zip", "w") as archive:
        archive.writestr(MEMBER, "\n".join([",".join(HEADER), *rows]) + "\n")
    source = WithLayouts(HM3DStatistics(tmp_path / "s.zip"), tmp_path / "layouts")
    hostile, plain = source.find().scenes
    assert hostile.scene_id == "../secret"
    assert "layout" not in str(hostile.geometry)
    assert "layout" in str(plain.geometry)
    manifest = build_dataset(source, tmp_path / "out")
    assert [skip.scene_id for skip in manifest.skipped] == ["../secret"]
    assert manifest.totals.adjacent == 1
