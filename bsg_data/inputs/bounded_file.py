"""Read files of people and other programs within a bound, packed with gzip or in a zip."""

from __future__ import annotations

import gzip
import hashlib
import io
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast

from bsg_data.errors import SourceError
from bsg_data.inputs.bounds import DATASET_TABLE, MAX_RATIO, MIB, Bound

PACKED = ".gz"
Refusal = Callable[..., Exception]  # of a message, `code` and `where`: a class of `BSGError`
_UNSUSPICIOUS = 16 * MIB  # unpacked, before a ratio is judged


class TooLargeError(OSError):
    """Report a file that is not hashed because it is larger than its bound."""


def read_bytes(path: Path, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Read a file whole, unpacked if its name ends in `.gz`.

    Args:
        path: of the file; a pipe and a device are read as well.
        bound: that it must keep, packed and unpacked.
        error: makes what is raised of a message.
    """
    return unpack(read_packed(path, bound, error=error), path, bound, error=error)


def read_packed(path: Path, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Read a file whole, as it lies there; see `read_bytes`."""
    with _refusing(path, error), path.open("rb") as file:
        _require_size(path.stat().st_size, path, bound, error)  # 0 of pipes and devices
        data = _take(file, bound)
    _require_size(len(data), path, bound, error)
    return data


def unpack(data: bytes, path: Path, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Unpack the bytes of a file if its name ends in `.gz`; see `read_bytes`."""
    if not path.name.endswith(PACKED):
        return data
    with _refusing(path, error):
        unpacked = _take(cast(BinaryIO, gzip.GzipFile(fileobj=io.BytesIO(data))), bound)
    _require_size(len(unpacked), path, bound, error)
    return unpacked


@contextmanager
def open_stream(path: Path, bound: Bound, *, error: Refusal = SourceError) -> Iterator[BinaryIO]:
    """Open a file to read it piece by piece, unpacked if its name ends in `.gz`."""
    with _refusing(path, error), path.open("rb") as file:
        counted = _Counted(file, path, bound, error)
        with io.BufferedReader(counted) as stream:
            yield cast(BinaryIO, stream)


def hash_file(path: Path, bound: Bound = DATASET_TABLE) -> str:
    """Return the sha256 of the bytes of a file, in hexadecimal digits.

    Args:
        path: of the file.
        bound: that it must keep; no kind of file that we write may be larger than the usual one.
    """
    with path.open("rb") as file:
        if path.stat().st_size > bound.bytes:
            raise TooLargeError(f"{path}: expected at most {bound.bytes:,} bytes, found more")
        digest = hashlib.sha256()
        while block := file.read(MIB):
            digest.update(block)
        return digest.hexdigest()


class _Counted(io.RawIOBase):
    """What is read of a file, counted against its bound."""

    def __init__(self, file: BinaryIO, path: Path, bound: Bound, error: Refusal) -> None:
        packed = path.name.casefold().endswith(PACKED)
        self._packed = file if packed else None
        self._file = cast(BinaryIO, gzip.GzipFile(fileobj=file)) if packed else file
        self._path, self._bound, self._error, self._done = path, bound, error, 0

    def readable(self) -> bool:
        """Say that it can be read."""
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read into a buffer and return how many bytes."""
        data = self._file.read(len(buffer))
        buffer[: len(data)] = data
        self._done += len(data)
        _require_size(self._done, self._path, self._bound, self._error)
        taken = self._done if self._packed is None else max(self._packed.tell(), 1)
        if self._done > max(_UNSUSPICIOUS, MAX_RATIO * taken):
            raise self._error(
                f"{self._path}: unpacks to more than {MAX_RATIO} times its size; unpack it, "
                "if it is what it should be",
                code="file-packed-too-well",
                where=self._path,
            )
        return len(data)


@contextmanager
def _refusing(path: Path, error: Refusal) -> Iterator[None]:
    try:
        yield
    except (gzip.BadGzipFile, EOFError, zlib.error) as fault:
        raise error(
            f"{path}: cannot be read (not a readable gzip file: {fault})",
            code="file-unreadable",
            where=path,
        ) from fault
    except OSError as fault:
        said = fault.strerror or fault
        raise error(
            f"{path}: cannot be read ({said})", code="file-unreadable", where=path
        ) from fault


def _take(file: BinaryIO, bound: Bound) -> bytes:
    """Return what a file has, one block more than its bound at most."""
    blocks, size = [], 0
    while size <= bound.bytes and (block := file.read(MIB)):
        blocks.append(block)
        size += len(block)
    return b"".join(blocks)


def _require_size(size: int, path: Path, bound: Bound, error: Refusal) -> None:
    if size > bound.bytes:
        raise error(
            f"{path}: expected at most {bound.bytes:,} bytes, found more",
            code="file-too-large",
            where=path,
        )


def read_member(path: Path, name: str, bound: Bound) -> bytes:
    """Read the one member of a zip that has a name, in whatever folder of it.

    Args:
        path: of the zip.
        name: of the file, without a folder.
        bound: of the zip, and of what the member unpacks to.
    """
    try:
        if not path.is_file() and path.exists():
            raise ValueError("it is no file")  # a device may have no end
        with zipfile.ZipFile(path) as archive:
            found = [one for one in archive.namelist() if PurePosixPath(one).name == name]
            if len(found) != 1:
                raise SourceError(
                    f"{path}: expected {name} inside once, found it {len(found)} times among "
                    f"{', '.join(archive.namelist()[:5]) or 'nothing'}",
                    code="zip-member-missing",
                    where=path,
                )
            with archive.open(found[0]) as member:
                data = member.read(bound.bytes + 1)
    except OSError as fault:
        raise SourceError(
            f"{path}: cannot be read ({fault.strerror or fault})",
            code="file-unreadable",
            where=path,
        ) from fault
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, ValueError) as fault:
        raise SourceError(
            f"{path}: not a readable zip file ({fault})", code="file-unreadable", where=path
        ) from fault
    if max(len(data), path.stat().st_size) > bound.bytes:
        raise SourceError(
            f"{path}: {name}: expected at most {bound.bytes:,} bytes, found more",
            code="file-too-large",
            where=path,
        )
    return data
