"""HM3D: annotation texts and the public statistics, by hand."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from conftest import KITCHEN, annotation_text, write_scene
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import AnnotationError, SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Room
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HEADER, HM3DFolder, parse_annotation
from bsg_data.sources.hm3d_stats import HEADER as COLUMNS
from bsg_data.sources.hm3d_stats import MEMBER
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
    for place in (blob, file):
        place.parent.mkdir(parents=True)
    blob.write_text(TEXT, "utf-8")
    file.symlink_to(blob)  # as git-annex and download caches lay files out
    (ref,) = HM3DFolder(tmp_path / "hm3d").find().scenes
    assert (ref.scene_id, ref.source_split, ref.source_version) == (scene_id, split, version)


def test_habitats_own_downloads_keep_their_newest_version(tmp_path: Path) -> None:
    """As `habitat_sim.utils.datasets_download` lays them out: the links come first by name."""
    data = tmp_path / "project-v9.0"
    places = ("val/00800-TEEsavR23oF", "minival/00800-TEEsavR23oF", "train/00006-HkseAnWCgqk")
    for version, names in {"0.1": ["bed"], "0.2": ["bed", "lamp"]}.items():
        for place in places:
            folder = data / f"versioned_data/hm3d-{version}/hm3d" / place
            write_scene(folder.parent, folder.name, annotation_text({0: names}))
        link = data / "scene_datasets" / {"0.1": "hm3d", "0.2": "hm3d_v0.2"}[version]
        link.parent.mkdir(exist_ok=True)
        link.symlink_to(f"../versioned_data/hm3d-{version}/hm3d")
    real = data / "versioned_data/hm3d-0.1/hm3d"
    roots = {  # whole, links alone, one version, a folder of it
        data: "v0.2",
        data / "scene_datasets": "v0.2",
        data / "scene_datasets/hm3d": "v0.1",
        data / "scene_datasets/hm3d_v0.2/val": "v0.2",
        real: "v0.1",
        real / "train": "v0.1",
    }
    for root, version in roots.items():
        found = HM3DFolder(root).find()
        assert {ref.source_version for ref in found.scenes} == {version}, root
        assert {"val", "train"} >= {ref.source_split for ref in found.scenes}, root
        assert len(found.conflicts) == (3 if root in (data, data / "scene_datasets") else 0)
    with refuses(SourceError, "scene-unreadable"):
        build_dataset(HM3DFolder(data), tmp_path / "dataset", strict=True)


def test_synthetic_buildings_are_never_taken_for_real_ones(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "made", scenes=2, seed=0))
    assert HM3DFolder(tmp_path / "made").kind == "synthetic"
    assert HM3DFolder(tmp_path / "made" / "train").kind == "synthetic"
    with refuses(SourceError, "source-mixed"):
        HM3DFolder(tmp_path).find()


def test_an_empty_source_says_where_it_looked(tmp_path: Path) -> None:
    with refuses(SourceError, "source-empty", tmp_path):
        HM3DFolder(tmp_path).find()
    (tmp_path / "file").touch()
    for name in ("none", "file"):
        with refuses(SourceError, "source-missing", tmp_path / name):
            HM3DFolder(tmp_path / name).find()


def test_byte_order_mark_carriage_returns_and_odd_separators_in_names() -> None:
    data = b'\xef\xbb\xbfHM3D Semantic Annotations\r\n1,F3A,"a\xe2\x80\xa8b",0\r\n'
    found, faults = parse_annotation(data, path=FILE)
    assert found.colours is not None
    assert (found.ids, [*found.names], found.regions) == ([1], ["a\u2028b"], (0,))
    assert ([*map(str, found.colours)], faults) == (["000F3A"], ())


MALFORMED = {
    b'1,AB,"chair"': "expected id,HEXRGB",
    b'1,AB,"chair,1': "expected id,HEXRGB",
    '1,AB,"chair",\u0663'.encode(): "expected id,HEXRGB",
    b'12345678901,AB,"chair",1': "expected id,HEXRGB",
    b'7,AC,"chair",1': "expected an id of no earlier line",
    b'8,AC,"ch\xe4ir",1': "expected UTF-8 text",
    b'8,0O3FA2,"chair",1': "expected a colour HEXRGB of no earlier line",
    b'8,1234567,"chair",1': "expected a colour HEXRGB of no earlier line",
    b'8,,"chair",1': "expected a colour HEXRGB of no earlier line",
    b'8,0000ff,"chair",1': "expected a colour HEXRGB of no earlier line",
}


def test_a_malformed_line_costs_a_line_and_all_are_reported(tmp_path: Path) -> None:
    """An object whose colour no mesh can have, or another has, is kept without one."""
    lines = [b'7,FF,"table",0', *MALFORMED, b'9,AB,"bed",1']
    for number, (line, why) in enumerate(MALFORMED.items(), start=1):
        found, (fault,) = parse_annotation(b"\n".join([HEADER.encode(), lines[0], line]), path=FILE)
        assert fault.startswith(f"line 3: {why}"), number
        assert len(found.names) == 1 + ("colour" in why)
    write_scene(tmp_path / "source", "00001-AbCdEfGhIjK", b"\n".join([HEADER.encode(), *lines]))
    source = HM3DFolder(tmp_path / "source")
    manifest = build_dataset(source, tmp_path / "out")
    numbers = [int(skip.reason.split()[1].strip(":")) for skip in manifest.left_out]
    assert numbers == [*range(3, 3 + len(MALFORMED))]
    (graph,) = read_scene_graphs(tmp_path / "out")
    assert [(obj.raw_category, obj.colour) for obj in graph.objects] == [
        ("table", "0000FF"),
        ("chair", None),
        ("bed", "0000AB"),
    ]
    with pytest.raises(SourceError, match=r"line 3: .*line 12: "):
        build_dataset(source, tmp_path / "strict", strict=True)


@pytest.mark.parametrize("data", ["", '1,AB,"chair",1\n', HEADER, f"{HEADER}\n1,A\n"])
def test_a_file_without_a_header_or_an_object_is_refused(data: str) -> None:
    with refuses(AnnotationError, "line-malformed"):
        parse_annotation(data.encode(), path=FILE)


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
    assert list(zip(found.ids or (), found.names, found.regions, strict=True)) == rows


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
    source = open_source("hm3d-stats", path)
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
        open_source("hm3d-stats", write_zip(tmp_path / "empty.zip")).find()
