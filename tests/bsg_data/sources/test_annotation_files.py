"""Files of annotations: walked without loops, one for each building."""

from __future__ import annotations

import os
from pathlib import Path

from bsg_data.sources.annotation_files import (
    keep_one_copy,
    list_files,
)
from bsg_data.sources.source import SceneRef


def test_a_walk_follows_links_and_ends(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    for name in ("z.house", "b/a.house", "b/.hidden.house", "b/other.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "b" / "round").symlink_to(tmp_path)
    (tmp_path / "lost.house").symlink_to(tmp_path / "nowhere")
    (tmp_path / "zero.house").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.house")
    found, unreadable = list_files(tmp_path, (".house",), expected="")
    assert [path.relative_to(tmp_path).as_posix() for path in found] == ["z.house", "b/a.house"]
    assert [(skip.location, skip.reason) for skip in unreadable] == [
        (f"{name}.house", "not a file, or a link that leads nowhere")
        for name in ("lost", "pipe", "zero")
    ]


def test_a_numbered_copy_then_the_newest_then_the_split_is_kept() -> None:
    copies = [
        SceneRef("a", "hash/alone", "f", "train", "v0.9", building="a"),
        SceneRef("00001-a", "minival", "f", "minival", "v0.10", building="a"),
        SceneRef("00001-a", "val", "f", "val", "v0.10", building="a"),
        SceneRef("00001-a", "older", "g", "train", "v0.2", building="a"),
    ]
    kept = keep_one_copy(copies, path=Path("hm3d"), expected="")
    assert [ref.location for ref in kept.scenes] == ["val"]
    assert [skip.location for skip in kept.duplicates] == ["hash/alone", "minival"]
    assert [skip.location for skip in kept.conflicts] == ["older"]
