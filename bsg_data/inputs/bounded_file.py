"""Read files of people and other programs within a bound: plain, gzip, or a member of a zip."""

from __future__ import annotations

import gzip
import hashlib
import io
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounds import DATASET_TABLE, MAX_RATIO, MIB
from bsg_data.words.shown import list_some

PACKED = ".gz"
Refusal = Callable[..., Exception]  # of a message, `code` and `where`: a class of `BSGError`
_DAMAGE = (OSError, EOFError, zlib.error)
# A RuntimeError of an encrypted member, a ValueError of a name that is no text.
ZIP_DAMAGE = (*_DAMAGE, zipfile.BadZipFile, struct.error, RuntimeError, ValueError)
UNSUSPICIOUS = 16 * MIB  # unpacked, before a ratio is judged


def read_bytes(path: Path, bound: int, *, error: Refusal = SourceError) -> bytes:
    """Read a file whole, also a pipe or a device; unpacked if its name ends in `.gz`."""
    with open_stream(path, bound, error=error) as file:
        return file.read()


def read_member(path: Path, name: str, bound: int) -> bytes:
    """Read the one member of a zip that has a name, in whatever folder; nothing goes to disk."""
    with _refusing(path, SourceError, ZIP_DAMAGE):
        if not path.is_file() and path.exists():
            raise OSError("it is no file")  # a device may have no end
        if path.stat().st_size > bound:
            raise _too_large(path, bound, SourceError)
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            found = [one for one in names if PurePosixPath(one).name == name]
            if len(found) != 1:
                raise SourceError(
                    f"{path}: expected {name} inside once, found it {len(found)} times among "
                    f"{list_some(names, 5) or 'nothing'}",
                    code="zip-member-missing",
                    where=path,
                )
            with archive.open(found[0]) as member:
                data = member.read(bound + 1)
        if len(data) > bound:
            raise _too_large(path, bound, SourceError)
        return data


@contextmanager
def open_stream(path: Path, bound: int, *, error: Refusal = SourceError) -> Iterator[BinaryIO]:
    """Open a file to read it piece by piece, unpacked if its name ends in `.gz`."""
    with (
        _refusing(path, error),
        path.open("rb") as file,
        io.BufferedReader(_Counted(file, path, bound, error)) as stream,
    ):
        yield cast(BinaryIO, stream)


def hash_file(path: Path, bound: int = DATASET_TABLE) -> str:
    """Return the sha256 of the bytes of a file, in hexadecimal digits.

    No kind of file that we write may be larger than the usual bound.
    """
    with path.open("rb") as file:
        if path.stat().st_size > bound:
            raise OSError(f"{path}: expected at most {bound:,} bytes, found more")
        digest = hashlib.sha256()
        while block := file.read(MIB):
            digest.update(block)
        return digest.hexdigest()


class _Counted(io.RawIOBase):
    """What is read of a file, counted against its bound."""

    def __init__(self, file: BinaryIO, path: Path, bound: int, error: Refusal) -> None:
        self._packed = file if path.name.casefold().endswith(PACKED) else None
        self._file = cast(BinaryIO, gzip.GzipFile(fileobj=file)) if self._packed else file
        self._path, self._bound, self._error, self._done = path, bound, error, 0

    def readable(self) -> bool:
        """Say that it can be read."""
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read into a buffer and return how many bytes."""
        data = self._file.read(len(buffer))
        buffer[: len(data)] = data
        self._done += len(data)
        if self._done > self._bound:
            raise _too_large(self._path, self._bound, self._error)
        taken = self._done if self._packed is None else max(self._packed.tell(), 1)
        if self._done > max(UNSUSPICIOUS, MAX_RATIO * taken):
            raise self._error(
                f"{self._path}: unpacks to more than {MAX_RATIO} times its size; unpack it, "
                "if it is what it should be",
                code="file-packed-too-well",
                where=self._path,
            )
        return len(data)


@contextmanager
def _refusing(
    path: Path, error: Refusal, damage: tuple[type[Exception], ...] = _DAMAGE
) -> Iterator[None]:
    try:
        yield
    except BSGError:  # of whoever reads within the block; some are a ValueError, too
        raise
    except damage as fault:
        message = f"{path}: cannot be read ({getattr(fault, 'strerror', None) or fault})"
        raise error(message, code="file-unreadable", where=path) from fault


def _too_large(path: Path, bound: int, error: Refusal) -> Exception:
    message = f"{path}: expected at most {bound:,} bytes, found more"
    return error(message, code="file-too-large", where=path)
