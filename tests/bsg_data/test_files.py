from __future__ import annotations

import os
from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_data.files import (
    open_beside,
    refuse_links,
    resolve_links,
    stem_of,
    write_bytes,
)


def test_a_file_is_whole_or_stays_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "file.json"
    write_bytes(path, b"one")
    assert path.read_bytes() == b"one"

    def fail() -> None:
        with open_beside(path) as partial:
            partial.write_bytes(b"half of tw")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_bytes() == b"one"
    write_bytes(path, b"two")
    assert path.read_bytes() == b"two"
    assert [p.name for p in path.parent.iterdir()] == ["file.json"]


@pytest.mark.parametrize(
    "way", ["loop", "loop/new", "missing/../loop", "dangling/../loop", "file/../loop", "to/loop"]
)
def test_a_way_through_a_link_that_leads_to_itself_is_refused(way: str, tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("other")
    (tmp_path / "other").symlink_to("loop")
    (tmp_path / "dangling").symlink_to("nowhere")
    (tmp_path / "to").symlink_to(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match=f"{way}: a link on the way leads to itself"):
        resolve_links(tmp_path / way)


def test_a_link_in_the_way_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("mine")
    for name in ("file", ".file.partial"):
        (tmp_path / name).symlink_to(victim)
    write_bytes(tmp_path / "file", b"new")
    assert victim.read_text() == "mine"
    assert (tmp_path / "file").read_bytes() == b"new"
    assert not (tmp_path / "file").is_symlink()


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(DatasetError, match=r"file/new: cannot be written \(Not a directory\)"):
        write_bytes(tmp_path / "file" / "new", b"")


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.mkdir()
    with pytest.raises(DatasetError, match="cannot be written"):
        write_bytes(path, b"x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


@pytest.mark.parametrize(
    ("name", "stem"),
    [("ceci-gcn", "ceci-gcn"), ("a (b)", "a-b"), ("../../x", "x"), ("..", "-"), ("", "-")],
)
def test_a_name_becomes_the_stem_of_a_file(name: str, stem: str) -> None:
    assert stem_of(name) == stem


def test_a_place_that_a_link_leads_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "root").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    root = tmp_path / "root"
    refuse_links(root, root / "a" / "b")  # neither is there yet; the root is what the user named
    (root / "a").symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(DatasetError, match="root/a: is a link"):
        refuse_links(root, root / "a" / "b")


def test_a_device_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DatasetError, match="pipe: is a device or a pipe"):
        write_bytes(tmp_path / "pipe", b"")
    assert (tmp_path / "pipe").is_fifo()
