"""Files are read within their bound: packed, without an end, and pipes that nobody fills."""

from __future__ import annotations

import gzip
import hashlib
import os
from pathlib import Path

import pytest

from bsg_data.errors import DatasetError, SourceError
from bsg_data.inputs import bounded_file
from bsg_data.inputs.bounded_file import (
    TooLargeError,
    hash_bounded,
    hash_file,
    open_stream,
    read_bytes,
)
from bsg_data.inputs.bounds import Bound


def test_reading_is_bounded_packed_or_not(tmp_path: Path) -> None:
    plain, packed = tmp_path / "a.txt", tmp_path / "a.txt.gz"
    plain.write_bytes(b"x" * 100)
    packed.write_bytes(gzip.compress(b"x" * 100))
    assert read_bytes(plain, Bound("", 100)) == read_bytes(packed, Bound("", 100)) == b"x" * 100
    with pytest.raises(SourceError, match=r"a\.txt: 100 bytes; expected at most 99"):
        read_bytes(plain, Bound("", 99))
    with pytest.raises(SourceError, match=r"a\.txt\.gz: unpacks to more than 99 bytes"):
        read_bytes(packed, Bound("", 99))
    with pytest.raises(SourceError, match=r"nothing: cannot be read \(No such file"):
        read_bytes(tmp_path / "nothing", Bound("", 1))


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs /dev/zero")
def test_a_file_without_an_end_is_refused_once_its_bound_is_read() -> None:
    zero, bound = Path("/dev/zero"), Bound("", 10_000_000)
    with pytest.raises(SourceError, match="more than 10,000,000 bytes"):
        read_bytes(zero, bound)
    with pytest.raises(TooLargeError, match="more than 10,000,000 bytes"):
        hash_bounded(zero, bound)
    with (
        pytest.raises(SourceError, match="more than 10,000,000 bytes"),
        open_stream(zero, bound) as file,
    ):
        file.read()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with a name")
def test_a_pipe_is_read_and_one_that_nobody_fills_is_not_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert read_bytes(pipe, Bound("", 9)) == b""
    reader, writer = os.pipe()
    os.write(writer, b"words")
    os.close(writer)
    assert read_bytes(Path(f"/dev/fd/{reader}"), Bound("", 9)) == b"words"
    os.close(reader)


def test_a_stream_is_bounded_by_bytes_and_by_how_well_it_is_packed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(b"\n" * 5_000_000))
    with open_stream(path, Bound("", 5_000_000)) as file:
        assert len(file.read()) == 5_000_000  # nothing is said of what is small
    with (
        pytest.raises(SourceError, match="more than 4,999,999 bytes"),
        open_stream(path, Bound("", 4_999_999)) as file,
    ):
        file.read()
    monkeypatch.setattr(bounded_file, "_UNSUSPICIOUS", 1_000_000)
    with (
        pytest.raises(SourceError, match="more than 200 times its size"),
        open_stream(path, Bound("", 5_000_000)) as file,
    ):
        file.read()


@pytest.mark.parametrize("name", ["none", "folder", "null\0", "cut.gz", "plain.gz"])
def test_whatever_cannot_be_read_is_one_error_of_the_readers_choice(
    tmp_path: Path, name: str
) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "cut.gz").write_bytes(gzip.compress(os.urandom(99))[:-9])
    (tmp_path / "plain.gz").write_bytes(b"plain")
    with pytest.raises(DatasetError, match="cannot be read"):
        read_bytes(tmp_path / name, Bound("", 999), error=DatasetError)
    with (
        pytest.raises(DatasetError, match="cannot be read"),
        open_stream(tmp_path / name, Bound("", 999), error=DatasetError) as file,
    ):
        file.read()


def test_a_file_that_is_too_large_is_hashed_by_nobody(tmp_path: Path) -> None:
    path = tmp_path / "sparse"
    path.write_bytes(b"one")
    assert hash_file(path) == hashlib.sha256(b"one").hexdigest()
    os.truncate(path, 300 * 2**30)  # no byte of it is read, or this test would take minutes
    with pytest.raises(TooLargeError, match="322,122,547,200 bytes; expected at most"):
        hash_file(path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="is no file on a disk"):
        hash_file(tmp_path / "pipe")
