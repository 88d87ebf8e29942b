"""Files are read within their bound, packed or not, and whatever is wrong is one error."""

from __future__ import annotations

import gzip
import hashlib
import os
import zipfile
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.errors import DatasetError, SourceError
from bsg_data.inputs import bounded_file
from bsg_data.inputs.bounded_file import (
    hash_file,
    open_stream,
    read_bytes,
    read_member,
)


def test_reading_is_bounded_packed_or_not(tmp_path: Path) -> None:
    plain, packed = tmp_path / "a.txt", tmp_path / "a.txt.gz"
    plain.write_bytes(b"x" * 100)
    packed.write_bytes(gzip.compress(b"x" * 100))
    assert read_bytes(plain, 100) == read_bytes(packed, 100) == b"x" * 100
    for path in (plain, packed):
        with refuses(SourceError, "file-too-large", path):
            read_bytes(path, 99)


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
def test_a_file_without_an_end_is_refused_once_its_bound_is_read() -> None:
    with refuses(SourceError, "file-too-large"):
        read_bytes(Path("/dev/zero"), 10_000_000)


def test_a_stream_is_bounded_by_how_well_it_is_packed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(b"\n" * 5_000_000))
    with open_stream(path, 5_000_000) as file:
        assert len(file.read()) == 5_000_000  # nothing is said of what is small
    monkeypatch.setattr(bounded_file, "UNSUSPICIOUS", 1_000_000)
    with (
        refuses(SourceError, "file-packed-too-well", path),
        open_stream(path, 5_000_000) as file,
    ):
        file.read()


@pytest.mark.parametrize("name", ["none", "folder", "cut.gz", "plain.gz"])
def test_whatever_cannot_be_read_is_one_error_of_the_readers_choice(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "cut.gz").write_bytes(gzip.compress(os.urandom(99))[:-9])
    (tmp_path / "plain.gz").write_bytes(b"plain")
    with refuses(DatasetError, "file-unreadable", tmp_path / name, golden=False):
        read_bytes(tmp_path / name, 999, error=DatasetError)


def test_a_file_that_is_too_large_is_not_hashed(tmp_path: Path) -> None:
    path = tmp_path / "sparse"
    path.write_bytes(b"one")
    assert hash_file(path) == hashlib.sha256(b"one").hexdigest()
    os.truncate(path, 300 * 2**30)  # no byte of it is read, or this test would take minutes
    with pytest.raises(OSError, match="expected at most"):
        hash_file(path)


def write_zip(path: Path, *members: tuple[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members:
            file.writestr(name, data)
    return path


def test_a_member_of_a_zip_is_there_once_and_within_its_bound(tmp_path: Path) -> None:
    path, bound = tmp_path / "a.zip", 100_000
    write_zip(path, ("other", b""), ("in/here/table.csv", b"words"))
    assert read_member(path, "table.csv", bound) == b"words"
    for members, code in (
        ([("a/table.csv", b"1"), ("b/table.csv", b"2")], "zip-member-missing"),
        ([("x" * 20_000, b""), *((f"{n}", b"") for n in range(9))], "zip-member-missing"),
        ([("table.csv", b"0" * 100_001)], "file-too-large"),
    ):
        write_zip(path, *members)
        with refuses(SourceError, code, path):
            read_member(path, "table.csv", bound)
    data = write_zip(path, ("table.csv", b"words" * 99)).read_bytes()
    for damaged in (b"", b"PK", data[: len(data) // 2], data.replace(b"PK\x03\x04", b"PK\x03\x05")):
        path.write_bytes(damaged)
        with refuses(SourceError, "file-unreadable", path, golden=False):
            read_member(path, "table.csv", bound)
