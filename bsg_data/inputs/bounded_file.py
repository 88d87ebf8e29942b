"""Read untrusted files within a bound, also pipes, devices and growing files.

All readers of this project open files here. A file that is too large is refused before more than
its bound is in memory. A file that never ends is refused after its bound was read.
"""

from __future__ import annotations

import errno
import gzip
import hashlib
import io
import os
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from bsg_data.errors import SourceError
from bsg_data.inputs.bounds import DATASET_TABLE, MAX_RATIO, MIB, Bound

PACKED = ".gz"
Refusal = Callable[[str], Exception]
_BLOCK = MIB
_UNSUSPICIOUS = 16 * MIB  # unpacked, before a ratio is judged


class TooLargeError(OSError):
    """Report a file that is not hashed because it is larger than its bound."""


def read_bytes(path: Path, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Read a file whole, unpacked if its name ends in `.gz`.

    Args:
        path: of the file; a pipe and a device are read as well.
        bound: that it must keep, packed and unpacked.
        error: makes what is raised of a message.

    Raises:
        SourceError: or what `error` makes, if it cannot be read, is no gzip though its name says
            so, or is larger.
    """
    return unpack(read_packed(path, bound, error=error), path, bound, error=error)


def read_packed(path: Path, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Read a file whole, as it lies there; see `read_bytes`."""
    with _refusing(path, error), open_waiting_for_none(path) as file:
        _require_size(file, path, bound, error)
        data = _take(file, bound.bytes)
        if len(data) > bound.bytes:
            raise error(f"{path}: more than {bound.bytes:,} bytes; expected at most these")
        return data


def unpack(data: bytes, path: Path, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Unpack the bytes of a file if its name ends in `.gz`; see `read_bytes`."""
    if not path.name.endswith(PACKED):
        return data
    with _refusing(path, error):
        unpacked = _take(cast(BinaryIO, gzip.GzipFile(fileobj=io.BytesIO(data))), bound.bytes)
    if len(unpacked) > bound.bytes:
        raise error(f"{path}: unpacks to more than {bound.bytes:,} bytes; expected at most these")
    return unpacked


@contextmanager
def open_stream(path: Path, bound: Bound, *, error: Refusal = SourceError) -> Iterator[BinaryIO]:
    """Open a file to read it piece by piece, unpacked if its name ends in `.gz`.

    Raises:
        SourceError: or what `error` makes, as `read_bytes`, also within the block.
    """
    with _refusing(path, error), open_waiting_for_none(path) as file:
        _require_size(file, path, bound, error)
        is_packed = path.name.casefold().endswith(PACKED)
        opened = cast(BinaryIO, gzip.GzipFile(fileobj=file)) if is_packed else file
        counted = _Counted(opened, file if is_packed else None, path, bound, error)
        with io.BufferedReader(counted) as stream:
            yield cast(BinaryIO, stream)


def hash_bounded(path: Path, bound: Bound) -> str:
    """Return the sha256 of the bytes of a file as they lie there.

    Raises:
        OSError: if it cannot be read.
        TooLargeError: if it is larger; one on a disk is not read then.
    """
    digest, left = hashlib.sha256(), bound.bytes
    with open_waiting_for_none(path) as file:
        _require_size(file, path, bound, TooLargeError)
        while block := file.read(_BLOCK):
            left -= len(block)
            if left < 0:
                raise TooLargeError(f"{path}: more than {bound.bytes:,} bytes")
            digest.update(block)
    return digest.hexdigest()


def hash_file(path: Path, bound: Bound = DATASET_TABLE) -> str:
    """Return the sha256 of a file on a disk, in hexadecimal digits.

    Args:
        path: of the file.
        bound: that it must keep; no kind of file that we write may be larger than the usual one.

    Raises:
        OSError: if it cannot be read, or is a pipe or a device, which may have no end.
        TooLargeError: if it is larger.
    """
    if not path.is_file() and path.exists():
        raise OSError(errno.EINVAL, "is no file on a disk", str(path))
    return hash_bounded(path, bound)


def open_waiting_for_none(path: Path) -> BinaryIO:
    """Open a file; a pipe into which nobody writes is empty, and is not waited for.

    Raises:
        OSError: if it cannot be opened.
    """
    at_once = getattr(os, "O_NONBLOCK", 0)  # Windows has no such pipes
    try:
        file = open(  # noqa: SIM115 -- whoever asks for it closes it
            path, "rb", opener=lambda name, flags: os.open(name, flags | at_once)
        )
    except ValueError as error:  # a null character in the path
        raise OSError(None, str(error), str(path)) from error
    if at_once:
        os.set_blocking(file.fileno(), True)
    return file


class _Counted(io.RawIOBase):
    """What is read of a file, counted against its bound."""

    def __init__(
        self, file: BinaryIO, packed: BinaryIO | None, path: Path, bound: Bound, error: Refusal
    ) -> None:
        self._file, self._packed, self._path = file, packed, path
        self._bound, self._error, self._done = bound, error, 0

    def readable(self) -> bool:
        """Say that it can be read."""
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read into a buffer and return how many bytes."""
        data = self._file.read(len(buffer))
        buffer[: len(data)] = data
        self._done += len(data)
        if self._done > self._bound.bytes:
            raise self._error(f"{self._path}: more than {self._bound.bytes:,} bytes; split it")
        if self._packed is not None and self._done > _UNSUSPICIOUS:
            taken = max(self._packed.tell(), 1)
            if self._done > MAX_RATIO * taken:
                raise self._error(
                    f"{self._path}: unpacks to more than {MAX_RATIO} times its size; unpack it, "
                    "if it is what it should be"
                )
        return len(data)


@contextmanager
def _refusing(path: Path, error: Refusal) -> Iterator[None]:
    try:
        yield
    except (gzip.BadGzipFile, EOFError, zlib.error) as fault:
        raise error(f"{path}: cannot be read (not a readable gzip file: {fault})") from fault
    except OSError as fault:
        raise error(f"{path}: cannot be read ({fault.strerror or fault})") from fault


def _require_size(file: BinaryIO, path: Path, bound: Bound, error: Refusal) -> None:
    size = os.fstat(file.fileno()).st_size  # 0 of pipes and devices, which are counted
    if size > bound.bytes:
        raise error(f"{path}: {size:,} bytes; expected at most {bound.bytes:,}")


def _take(file: BinaryIO, most: int) -> bytes:
    """Return what a file has, one byte more than the most at most."""
    pieces, left = [], most + 1
    while left and (piece := file.read(min(left, _BLOCK))):
        pieces.append(piece)
        left -= len(piece)
    return b"".join(pieces)
