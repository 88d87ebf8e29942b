from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from bsg_data.errors import BSGError, DatasetError
from bsg_data.files import (
    FigureError,
    hold,
    noting_failures,
    open_beside,
    refuse_links,
    write_bytes,
    write_figure,
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


def test_a_link_in_the_way_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("mine")
    for name in ("file", ".file.partial"):
        (tmp_path / name).symlink_to(victim)
    write_bytes(tmp_path / "file", b"new")
    assert victim.read_text() == "mine"
    assert not (tmp_path / "file").is_symlink()
    (tmp_path / "root").symlink_to(tmp_path, target_is_directory=True)
    refuse_links(tmp_path / "root", tmp_path / "root" / "a" / "b")  # what the user named may be one
    (tmp_path / "a").symlink_to(tmp_path, target_is_directory=True)
    with pytest.raises(DatasetError, match="root/a: is a link"):
        refuse_links(tmp_path / "root", tmp_path / "root" / "a" / "b")


def test_what_cannot_be_written_is_named_and_what_was_there_stays(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(DatasetError, match=r"file/new: cannot be written \(Not a directory\)"):
        write_bytes(tmp_path / "file" / "new", b"")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DatasetError, match="pipe: is a device or a pipe"):
        write_bytes(tmp_path / "pipe", b"")
    (tmp_path / "folder").mkdir()
    with pytest.raises(DatasetError, match="cannot be written"):
        write_bytes(tmp_path / "folder", b"x")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder", "pipe"]


# Figures


def test_the_suffix_names_the_format(tmp_path: Path) -> None:
    write_figure(Figure(), tmp_path / "a.png")
    write_figure(Figure(), tmp_path / "new" / "a.pdf")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "new" / "a.pdf").read_bytes().startswith(b"%PDF")
    for name, message in (("a", "take .*a.png"), ("a.doc", "a.doc: the figure")):
        with pytest.raises(BSGError, match=message):
            write_figure(Figure(), tmp_path / name)


def test_a_figure_that_cannot_be_drawn_is_a_note_and_a_full_disk_is_not(tmp_path: Path) -> None:
    class Failing:
        """A figure as .pgf where there is no LaTeX, or on a full disk."""

        def savefig(self, fname: Any, **how: Any) -> None:
            raise (
                RuntimeError("no LaTeX") if how["format"] == "pgf" else OSError(28, "No space left")
            )

    notes: list[str] = []
    with noting_failures(notes):
        write_figure(Failing(), tmp_path / "a.pgf")
    assert notes[0].startswith(f"note: a figure is missing: {tmp_path}/a.pgf")
    with pytest.raises(BSGError, match="No space left") as caught, noting_failures(notes):
        write_figure(Failing(), tmp_path / "a.png")
    assert not isinstance(caught.value, FigureError)


# Locks


def test_one_holder_at_a_time_and_no_trace(tmp_path: Path) -> None:
    folder = tmp_path / "dataset"
    folder.mkdir()
    (tmp_path / "link").symlink_to(folder)
    for name in ("dataset", "link"):
        with hold(tmp_path / name):
            with pytest.raises(DatasetError, match="another command is writing there"):
                hold(folder).__enter__()
            with hold(tmp_path / "another"):
                assert list(folder.iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset", "link"]


def test_a_place_that_cannot_be_locked_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="nowhere: no such folder"):
        hold(tmp_path / "nowhere" / "dataset").__enter__()
    (tmp_path / ".other.lock").mkdir()
    with pytest.raises(DatasetError, match=r"cannot be locked by .*\.other\.lock"):
        hold(tmp_path / "other").__enter__()
    (tmp_path / ".third.lock").symlink_to(tmp_path / "victim")
    with pytest.raises(DatasetError, match="cannot be locked"):
        hold(tmp_path / "third").__enter__()
    assert not (tmp_path / "victim").exists()
