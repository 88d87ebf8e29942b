from __future__ import annotations

import os
from pathlib import Path

import pytest
from conftest import KITCHEN, annotation_text, write_scene
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.inputs.bounds import SYNTHETIC
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Edge, Room
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

TEXT = annotation_text({0: KITCHEN})


def test_one_building_by_hand(tmp_path: Path) -> None:
    names = {5: ["Wall", "CHAIR"], 0: ["fridge", "zzqx"], -1: ["book"], -7: [""]}
    write_scene(tmp_path, "00006-HkseAnWCgqk", annotation_text(names))
    source = HM3DFolder(tmp_path)
    (ref,) = source.find().scenes
    class_map = load_class_map()
    graph = source.read(ref, class_map).graph
    assert graph.rooms == (Room(1, 0), Room(2, 5))
    assert [(o.raw_category, o.category, o.room_index) for o in graph.objects] == [
        ("Wall", "wall", 2),
        ("CHAIR", "chair", 2),
        ("fridge", "refrigerator", 1),
        ("zzqx", None, 1),
        ("book", "book", 0),
        ("", "unknown", 0),
    ]
    classes = [
        None if o.class_index is None else class_map.classes[o.class_index] for o in graph.objects
    ]
    assert classes == [None, "chair", "refrigerator", None, "book", None]
    assert [(e.source, e.target) for e in graph.edges()] == [
        (0, 1),
        (0, 2),
        (2, 3),
        (2, 4),
        (1, 5),
        (1, 6),
        (0, 7),
        (0, 8),
    ]
    assert all(isinstance(e, Edge) and e.kind == "contains" for e in graph.edges())
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
        ("x/00801-HaxA7YrQdEC/HaxA7YrQdEC_semantic.txt", "00801-HaxA7YrQdEC", "val", None),
        ("HaxA7YrQdEC.semantic.txt", "HaxA7YrQdEC", None, None),
        ("v0.1/minival/odd/HaxA7YrQdEC.semantic.txt", "HaxA7YrQdEC", "minival", "v0.1"),
    ],
)
def test_the_path_says_id_split_and_version(
    tmp_path: Path, path: str, scene_id: str, split: str | None, version: str | None
) -> None:
    file = tmp_path / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(TEXT, "utf-8")
    (ref,) = HM3DFolder(tmp_path).find().scenes
    assert (ref.scene_id, ref.source_split, ref.source_version) == (scene_id, split, version)


def test_a_building_found_twice_is_taken_once(tmp_path: Path) -> None:
    write_scene(tmp_path, "00801-HaxA7YrQdEC", TEXT, split="minival")
    write_scene(tmp_path, "00801-HaxA7YrQdEC", TEXT, split="val")
    write_scene(tmp_path, "copy-HaxA7YrQdEC", TEXT + '99,ABCDEF,"bed",0\n', split="a")
    found = HM3DFolder(tmp_path).find()
    assert [ref.source_split for ref in found.scenes] == ["val"]
    assert [(d.location.split("/")[0], d.reason.split()[-3:]) for d in found.duplicates] == [
        ("a", ["with", "OTHER", "annotation"]),
        ("minival", ["the", "same", "annotation"]),
    ]


def test_links_are_followed_but_not_in_circles(tmp_path: Path) -> None:
    write_scene(tmp_path / "real", "00006-HkseAnWCgqk", TEXT)
    root = tmp_path / "root"
    root.mkdir()
    (root / "linked").symlink_to(tmp_path / "real", target_is_directory=True)
    (tmp_path / "real" / "loop").symlink_to(root, target_is_directory=True)
    found = HM3DFolder(root).find()
    assert [ref.scene_id for ref in found.scenes] == ["00006-HkseAnWCgqk"]
    assert found.duplicates == ()


def test_a_linked_annotation_keeps_its_number(tmp_path: Path) -> None:
    """As git-annex and download caches lay files out."""
    blob = tmp_path / "blobs" / "deadbeef"
    blob.parent.mkdir()
    blob.write_text(TEXT, "utf-8")
    link = tmp_path / "hm3d" / "00006-HkseAnWCgqk" / "HkseAnWCgqk.semantic.txt"
    link.parent.mkdir(parents=True)
    link.symlink_to(blob)
    (ref,) = HM3DFolder(tmp_path / "hm3d").find().scenes
    assert ref.scene_id == "00006-HkseAnWCgqk"


def test_what_is_no_file_is_reported_and_never_opened(tmp_path: Path) -> None:
    write_scene(tmp_path, "00006-HkseAnWCgqk", TEXT)
    folder = tmp_path / "train" / "odd"
    folder.mkdir()
    os.mkfifo(folder / "pipe.semantic.txt")
    (folder / "self.semantic.txt").symlink_to(folder / "self.semantic.txt")
    (folder / "zero.semantic.txt").symlink_to("/dev/zero")
    found = HM3DFolder(tmp_path).find()
    assert len(found.scenes) == 1
    assert [skip.location.split("/")[-1] for skip in found.unreadable] == [
        "pipe.semantic.txt",
        "self.semantic.txt",
        "zero.semantic.txt",
    ]


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = write_scene(tmp_path, "00006-HkseAnWCgqk", TEXT)
    os.truncate(path, 10 * 2**30)  # sparse: it takes no disk
    source = HM3DFolder(tmp_path)
    (ref,) = source.find().scenes
    with refuses(SourceError, "file-too-large", path):
        source.read(ref, load_class_map())


def test_the_newest_version_of_a_building_is_taken(tmp_path: Path) -> None:
    for version in ("v0.1", "v0.2"):
        write_scene(tmp_path / f"hm3d-train-semantic-annots-{version}", "00006-HkseAnWCgqk", TEXT)
    found = HM3DFolder(tmp_path).find()
    assert [ref.source_version for ref in found.scenes] == ["v0.2"]


def test_synthetic_buildings_are_never_taken_for_real_ones(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path / "made", scenes=2, seed=0))
    assert HM3DFolder(tmp_path / "made").kind == "synthetic"
    assert HM3DFolder(tmp_path / "made" / "train").kind == "synthetic"
    with refuses(SourceError, "source-mixed"):
        HM3DFolder(tmp_path).find()
    stream = write_synthetic(tmp_path / "half", scenes=2, seed=0)
    next(stream)
    with refuses(SourceError, "source-unfinished"):
        HM3DFolder(tmp_path / "half").find()
    stream.close()  # which ends its lock
    assert len(list(write_synthetic(tmp_path / "half", scenes=2, seed=0))) == 2


def test_a_mark_of_synthetic_buildings_has_a_bound(tmp_path: Path) -> None:
    list(write_synthetic(tmp_path, scenes=1, seed=0))
    mark = tmp_path / "synthetic.json"
    mark.write_text(mark.read_text("utf-8") + " " * SYNTHETIC.bytes, "utf-8")
    with refuses(SourceError, "file-too-large", mark):
        HM3DFolder(tmp_path).find()


def test_hidden_files_of_archives_are_no_scenes(tmp_path: Path) -> None:
    path = write_scene(tmp_path, "00006-HkseAnWCgqk", TEXT)
    path.with_name("._HkseAnWCgqk.semantic.txt").write_bytes(b"\x00\x05\x16\x07")
    assert len(HM3DFolder(tmp_path).find().scenes) == 1


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
    with refuses(SourceError, "source-missing"):
        HM3DFolder(tmp_path / "none").find()
    file = tmp_path / "file"
    file.touch()
    with refuses(SourceError, "source-missing", file):
        HM3DFolder(file).find()
