from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.hm3d_stats import MEMBER, HM3DStatistics

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
    source = HM3DStatistics(path)
    refs = source.find().scenes
    assert [(r.scene_id, r.source_split, r.source_version) for r in refs] == [
        ("00006-aaaaaaaaaaa", "train", "v0.2"),
        ("00801-bbbbbbbbbbb", "val", "v0.2"),
    ]
    graph = source.read(refs[0], load_class_map()).graph
    assert [room.region_id for room in graph.rooms] == [4]
    assert [(o.instance_id, o.room_index, o.raw_category) for o in graph.objects] == [
        (3, 1, "chair"),
        (7, 1, "some_thing"),
        (12, 1, "chair"),
        (20, 0, "book"),
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
    source = HM3DStatistics(path)
    (ref,) = source.find().scenes
    with refuses(AnnotationError, "line-malformed", f"{path / MEMBER}, line 3"):
        source.read(ref, load_class_map())


def test_an_empty_table_says_so(tmp_path: Path) -> None:
    with refuses(SourceError, "source-empty"):
        HM3DStatistics(write_zip(tmp_path / "empty.zip")).find()
