"""Files of annotations: walked without loops, read within a bound, packed or not."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from bsg_data.errors import AnnotationError, SourceChangedError, SourceError
from bsg_data.sources.annotation_files import decode, fingerprint, read_bytes, walk_files
from bsg_data.sources.source import SkippedScene


def test_a_walk_follows_links_and_ends(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    for name in ("z.house", "b/a.house", "b/.hidden.house", "b/other.txt"):
        (tmp_path / name).write_text("")
    (tmp_path / "b" / "round").symlink_to(tmp_path)
    (tmp_path / "lost.house").symlink_to(tmp_path / "nowhere")
    unreadable: list[SkippedScene] = []
    found = list(walk_files(tmp_path, (".house",), unreadable))
    assert [path.relative_to(tmp_path).as_posix() for path in found] == ["z.house", "b/a.house"]
    assert [(skip.location, skip.reason) for skip in unreadable] == [
        ("lost.house", "not a file, or a link that leads nowhere")
    ]


def test_reading_is_bounded_packed_or_not(tmp_path: Path) -> None:
    plain, packed = tmp_path / "a.txt", tmp_path / "a.txt.gz"
    plain.write_bytes(b"x" * 100)
    packed.write_bytes(gzip.compress(b"x" * 100))
    assert read_bytes(plain, most=100) == read_bytes(packed, most=100) == b"x" * 100
    with pytest.raises(SourceError, match=r"a\.txt: 100 bytes; expected at most 99"):
        read_bytes(plain, most=99)
    with pytest.raises(SourceError, match=r"a\.txt\.gz: unpacks to more than 99 bytes"):
        read_bytes(packed, most=99)
    with pytest.raises(SourceError, match=r"nothing: cannot be read \(No such file"):
        read_bytes(tmp_path / "nothing", most=1)


def test_a_fingerprint_tells_files_apart(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    (tmp_path / "b").write_text("2")
    marks = [fingerprint(tmp_path / name, most=9) for name in ("a", "b")]
    assert len(set(marks)) == 2
    with pytest.raises(SourceChangedError, match=r"c: cannot be read \(No such file"):
        fingerprint(tmp_path / "c", most=9)
    assert fingerprint(tmp_path / "a", most=0) == "too large"


def test_the_line_that_is_no_text_is_named() -> None:
    with pytest.raises(AnnotationError, match=r"a\.txt, line 2: expected UTF-8 text"):
        decode(b"a\nb\xff", path=Path("a.txt"))
