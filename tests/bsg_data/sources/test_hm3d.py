"""HM3D: annotation texts and the public statistics, by hand."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path

import pytest
from conftest import KITCHEN, annotation_text, write_scene
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.errors import AnnotationError, SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import AnnotatedObject, Room
from bsg_data.sources.hm3d import HEADER, HM3DFolder, parse_annotation, split_scene_id
from bsg_data.sources.hm3d_stats import HEADER as COLUMNS
from bsg_data.sources.hm3d_stats import MEMBER, HM3DStatistics
from bsg_data.synthetic.buildings import write_synthetic

FILE = Path("scene.semantic.txt")
TEXT = annotation_text({0: KITCHEN})


def test_one_building_by_hand(tmp_path: Path) -> None:
    names = {5: ["Wall", "CHAIR"], 0: ["fridge", "zzqx"], -1: ["book"], -7: [""]}
    write_scene(tmp_path, "00006-HkseAnWCgqk", annotation_text(names))
    source = HM3DFolder(tmp_path)
    (ref,) = source.find().scenes
    class_map = load_class_map()
    graph = source.read(ref, class_map).graph
    assert graph.rooms == (Room(1, 0), Room(2, 5))
    found = [(o.raw_category, o.category, o.class_index, o.room_index) for o in graph.objects]
    assert found == [
        ("Wall", "wall", None, 2),
        ("CHAIR", "chair", class_map.classes.index("chair"), 2),
        ("fridge", "refrigerator", class_map.classes.index("refrigerator"), 1),
        ("zzqx", None, None, 1),
        ("book", "book", class_map.classes.index("book"), 0),
        ("", "unknown", None, 0),
    ]
    assert (graph.source, graph.source_split, graph.source_version) == ("hm3d", "train", None)


@pytest.mark.parametrize(
    ("path", "scene_id", "split", "version"),
    [
        ("train/00006-HkseAnWCgqk/HkseAnWCgqk.semantic.txt", "00006-HkseAnWCgqk", "train", None),
        (
            "hm3d-val-semantic-annots-v0.2/00801-HaxA7YrQdEC/HaxA7YrQdEC.semantic.txt",
            "00801-HaxA7YrQdEC",
            "val",
            "v0.2",
        ),
        ("validation/00899-HaxA7YrQdEC/HaxA7YrQdEC_semantic.txt", "00899-HaxA7YrQdEC", "val", None),
        ("00900-HaxA7YrQdEC/HaxA7YrQdEC_semantic.txt", "00900-HaxA7YrQdEC", "test", None),
        ("HaxA7YrQdEC.semantic.txt", "HaxA7YrQdEC", None, None),
        ("v0.1/minival/odd/HaxA7YrQdEC.semantic.txt", "HaxA7YrQdEC", "minival", "v0.1"),
    ],
)
def test_the_path_says_id_split_and_version(
    tmp_path: Path, path: str, scene_id: str, split: str | None, version: str | None
) -> None:
    blob = tmp_path / "blobs" / "deadbeef"
    file = tmp_path / "hm3d" / path
    for one in (blob, file):
        one.parent.mkdir(parents=True)
    blob.write_text(TEXT, "utf-8")
    file.symlink_to(blob)  # as git-annex and download caches lay files out
    (ref,) = HM3DFolder(tmp_path / "hm3d").find().scenes
    assert (ref.scene_id, ref.source_split, ref.source_version) == (scene_id, split, version)


def test_what_is_no_file_is_reported_and_never_opened(tmp_path: Path) -> None:
    write_scene(tmp_path, "00006-HkseAnWCgqk", TEXT)
    folder = tmp_path / "train" / "odd"
    folder.mkdir()
    os.mkfifo(folder / "pipe.semantic.txt")
    (folder / "self.semantic.txt").symlink_to(folder / "self.semantic.txt")
    (folder / "zero.semantic.txt").symlink_to("/dev/zero")
    found = HM3DFolder(tmp_path).find()
    assert len(found.scenes) == 1
    left = [skip.location.split("/")[-1] for skip in found.unreadable]
    assert left == ["pipe.semantic.txt", "self.semantic.txt", "zero.semantic.txt"]


def test_synthetic_buildings_are_never_taken_for_real_ones(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "made", scenes=2, seed=0))
    assert HM3DFolder(tmp_path / "made").kind == "synthetic"
    assert HM3DFolder(tmp_path / "made" / "train").kind == "synthetic"
    with refuses(SourceError, "source-mixed"):
        HM3DFolder(tmp_path).find()
    stream = write_synthetic(tmp_path / "half", scenes=2, seed=0)
    next(stream)
    with refuses(SourceError, "source-unfinished"):
        HM3DFolder(tmp_path / "half.partial").find()
    stream.close()  # which ends its lock
    assert len(list(write_synthetic(tmp_path / "half", scenes=2, seed=0))) == 2


def test_a_folder_whose_name_is_no_text_is_named(tmp_path: Path) -> None:
    root = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9/b"))
    try:
        write_scene(root, "00006-HkseAnWCgqk", TEXT)
    except OSError:
        pytest.skip("this file system takes no such name")
    with refuses(SourceError, "source-unreadable"):
        HM3DFolder(root).find()


def test_an_empty_source_says_where_it_looked(tmp_path: Path) -> None:
    with refuses(SourceError, "source-empty", tmp_path):
        HM3DFolder(tmp_path).find()
    (tmp_path / "file").touch()
    for name in ("none", "file"):
        with refuses(SourceError, "source-missing", tmp_path / name):
            HM3DFolder(tmp_path / name).find()


def test_byte_order_mark_carriage_returns_and_odd_separators_in_names() -> None:
    data = b'\xef\xbb\xbfHM3D Semantic Annotations\r\n1,F3A,"a\xe2\x80\xa8b",0\r\n'
    (found,), faults = parse_annotation(data, path=FILE)
    assert found == AnnotatedObject(1, 0, "a\u2028b", "000F3A")
    assert faults == ()


@pytest.mark.parametrize(
    "line",
    [
        '1,AB,"chair"',
        '1,AB,"chair,1',
        '1,AB,"chair",٣',
        '12345678901,AB,"chair",1',
        '7,AC,"chair",1',
        b'8,AC,"ch\xe4ir",1',
    ],
)
def test_a_malformed_line_is_named(line: str | bytes) -> None:
    data = line if isinstance(line, bytes) else line.encode()
    with refuses(AnnotationError, "line-malformed", "scene.semantic.txt, line 3"):
        parse_annotation(f'{HEADER}\n7,FF,"table",0\n'.encode() + data, path=FILE)


@pytest.mark.parametrize("colour", ["0O3FA2", "1234567", "", "0000ff", "red", "#AB"])
def test_an_object_whose_colour_cannot_be_is_kept_without_one(colour: str, tmp_path: Path) -> None:
    """No mesh can have it, or another object has it; the building stays, and the report says it."""
    text = f'{HEADER}\n7,FF,"table",0\n8,{colour},"radiator",1\n9,AB,"bed",1\n'
    write_scene(tmp_path / "source", "00001-AbCdEfGhIjK", text)
    source = HM3DFolder(tmp_path / "source")
    (ref,) = source.find().scenes
    reading = source.read(ref, load_class_map())
    assert [obj.colour for obj in reading.graph.objects] == ["0000FF", None, "0000AB"]
    assert len(reading.graph.rooms) == 2
    (left,) = reading.left_out
    assert left.reason.startswith("line 3: expected a colour HEXRGB of no earlier line")
    with pytest.raises(SourceError, match="kept without a colour"):
        build_dataset(source, tmp_path / "strict", strict=True)
    manifest = build_dataset(source, tmp_path / "out")
    assert (manifest.totals.objects, len(manifest.left_out)) == (3, 1)


@pytest.mark.parametrize("data", [b"", b'1,AB,"chair",1\n', HEADER.encode()])
def test_another_file_is_refused_by_its_first_line(data: bytes) -> None:
    with refuses(AnnotationError, "line-malformed", f"{FILE}, line 1"):
        parse_annotation(data, path=FILE)


names = st.text(st.characters(exclude_characters="\n\r", exclude_categories=["Cs"]), max_size=20)


@given(
    st.lists(
        st.tuples(st.integers(0, 10**9 - 1), names, st.integers(-5, 1000)),
        min_size=1,
        unique_by=lambda row: row[0],
    )
)
def test_any_names_come_back_exactly(rows: list[tuple[int, str, int]]) -> None:
    lines = [f'{i},{k:X},"{name}",{region}' for k, (i, name, region) in enumerate(rows)]
    found, _ = parse_annotation("\n".join([HEADER, *lines]).encode(), path=FILE)
    assert {(f.instance_id, f.name, f.region_id) for f in found} == set(rows)
    assert [f.instance_id for f in found] == sorted(i for i, _, _ in rows)


@pytest.mark.parametrize(
    ("scene_id", "number", "building"),
    [
        ("00006-HkseAnWCgqk", 6, "HkseAnWCgqk"),
        ("HkseAnWCgqk", None, "HkseAnWCgqk"),
        ("6-HkseAnWCgqk", None, "6-HkseAnWCgqk"),
        ("00006-", None, "00006-"),
        ("240101-office", None, "240101-office"),
        ("1234567-HkseAnWCgqk", 1234567, "HkseAnWCgqk"),
    ],
)
def test_a_number_has_five_digits_and_a_hash_behind_it(
    scene_id: str, number: int | None, building: str
) -> None:
    assert split_scene_id(scene_id) == (number, building)


def write_zip(path: Path, *rows: str) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(MEMBER, "\n".join([",".join(COLUMNS), *rows]) + "\n")
    return path


def test_statistics_by_hand(tmp_path: Path) -> None:
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
    with refuses(SourceError, "source-empty"):
        HM3DStatistics(write_zip(tmp_path / "empty.zip")).find()
