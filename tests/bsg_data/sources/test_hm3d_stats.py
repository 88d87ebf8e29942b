from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.hm3d_stats import MEMBER, HM3DStatistics, parse_scene_lines, read_scene_lines

HEADER = "Scene Name,Region #,# Unique Categories,# Objects,Object Instances in Region,Category"


def write_zip(path: Path, *rows: str, member: str = MEMBER) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(member, "\n".join([HEADER, *rows]) + "\n")
    return path


def test_a_table_by_hand(tmp_path: Path) -> None:
    path = write_zip(
        tmp_path / "HM3DSem-v0.2.zip",
        "00801-bbbbbbbbbbb,0,1,1,bed_1",
        "00006-aaaaaaaaaaa,4,2,3,chair_12:chair_3:some_thing_7",
        "00006-aaaaaaaaaaa,-1,1,1,book_20",
    )
    scenes = read_scene_lines(path)
    assert list(scenes) == ["00006-aaaaaaaaaaa", "00801-bbbbbbbbbbb"]
    found = parse_scene_lines(scenes["00006-aaaaaaaaaaa"], path=path)
    assert found == (
        SceneObject(0, 3, 4, "chair"),
        SceneObject(0, 7, 4, "some_thing"),
        SceneObject(0, 12, 4, "chair"),
        SceneObject(0, 20, -1, "book"),
    )
    refs = HM3DStatistics(path).find().scenes
    assert [(r.source_split, r.source_version) for r in refs] == [
        ("train", "v0.2"),
        ("val", "v0.2"),
    ]


@pytest.mark.parametrize(
    "row",
    [
        "s,0,1,2,chair_1",
        "s,0,1,1,chair",
        "s,0,1,1",
        "s,zero,1,1,chair_1",
        "s,1,1,1,chair_9",
        "s,7,1,1,chair_1",
        's,0,1,1,"chair_1',
    ],
)
def test_a_malformed_row_is_named(tmp_path: Path, row: str) -> None:
    path = write_zip(tmp_path / "s.zip", "s,7,1,1,bed_9", row)
    with refuses(AnnotationError, "line-malformed", f"{path / MEMBER}, line 3"):
        parse_scene_lines(read_scene_lines(path)["s"], path=path)


def test_an_empty_table_says_so(tmp_path: Path) -> None:
    with refuses(SourceError, "source-empty"):
        HM3DStatistics(write_zip(tmp_path / "empty.zip")).find()


def test_the_source_travels_without_its_table(tmp_path: Path) -> None:
    source = HM3DStatistics(write_zip(tmp_path / "s.zip", "s,0,1,1,chair_1"))
    ref = source.find().scenes[0]
    kind, arguments = source.__reduce__()
    copy = kind(*arguments)  # type: ignore[operator, misc]
    class_map = load_class_map()
    assert copy.read(ref, class_map) == source.read(ref, class_map)
