from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.inputs.bounds import Bound
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.annotations import Instance
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
    found = parse_scene_lines(scenes["00006-aaaaaaaaaaa"], path=path).instances
    assert found == (
        Instance(3, "chair", 4),
        Instance(7, "some_thing", 4),
        Instance(12, "chair", 4),
        Instance(20, "book", -1),
    )
    refs = HM3DStatistics(path).find().scenes
    assert [(r.source_split, r.source_version) for r in refs] == [
        ("train", "v0.2"),
        ("val", "v0.2"),
    ]


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("s,0,1,2,chair_1", "2 instances"),
        ("s,0,1,1,chair", "<name>_<instance id>"),
        ("s,0,1,1", "Scene Name"),
        ("s,zero,1,1,chair_1", "Scene Name"),
        ("s,1,1,1,chair_9", "an instance id that no earlier region"),
        ("s,7,1,1,chair_1", "region 7 of this scene once"),
        ('s,0,1,1,"chair_1', "comma separated"),
    ],
)
def test_a_malformed_row_is_named(tmp_path: Path, row: str, expected: str) -> None:
    path = write_zip(tmp_path / "s.zip", "s,7,1,1,bed_9", row)
    with pytest.raises(AnnotationError, match="line 3") as caught:
        parse_scene_lines(read_scene_lines(path)["s"], path=path)
    assert expected in caught.value.expected


def test_damaged_and_foreign_zips_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="cannot be read"):
        read_scene_lines(tmp_path / "none.zip")
    other = write_zip(tmp_path / "other.zip", member="readme.txt")
    with pytest.raises(SourceError, match=r"expected Per_Scene.*among readme.txt"):
        read_scene_lines(other)
    whole = write_zip(tmp_path / "whole.zip", *["s,0,1,1,chair_1"] * 50).read_bytes()
    cut = tmp_path / "cut.zip"
    cut.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SourceError, match="not a readable zip"):
        read_scene_lines(cut)
    spoiled = tmp_path / "spoiled.zip"
    spoiled.write_bytes(whole.replace(b"chair_1", b"chair_2", 1))
    with pytest.raises(SourceError, match="not a readable zip"):
        read_scene_lines(spoiled)


def test_a_zip_bomb_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_zip(tmp_path / "bomb.zip", *["s,0,1,1,chair_1"] * 400)
    monkeypatch.setattr("bsg_data.sources.hm3d_stats.STATISTICS", Bound("", 2000))
    with pytest.raises(SourceError, match="expected at most 2,000"):
        read_scene_lines(path)


def test_an_empty_table_says_so(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="has no row"):
        HM3DStatistics(write_zip(tmp_path / "empty.zip")).find()


def test_the_source_travels_without_its_table(tmp_path: Path) -> None:
    source = HM3DStatistics(write_zip(tmp_path / "s.zip", "s,0,1,1,chair_1"))
    ref = source.find().scenes[0]
    kind, arguments = source.__reduce__()
    copy = kind(*arguments)  # type: ignore[operator, misc]
    class_map = load_class_map()
    assert copy.read(ref, class_map) == source.read(ref, class_map)
