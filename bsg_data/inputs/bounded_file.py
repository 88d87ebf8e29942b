"""Read files of people and other programs: plain, gzip, or a member of a zip.

Only what comes by the network has a bound.
"""

from __future__ import annotations

import gzip
import hashlib
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import BinaryIO, cast

from bsg_data.errors import BSGError, SourceError
from bsg_data.words.shown import list_some

PACKED = ".gz"
Refusal = Callable[..., Exception]  # of a message, `code` and `where`: a class of `BSGError`
_DAMAGE = (OSError, EOFError, zlib.error)
# A RuntimeError of an encrypted member, a ValueError of a name that is no text.
_ZIP_DAMAGE = (*_DAMAGE, zipfile.BadZipFile, struct.error, RuntimeError, ValueError)


def read_bytes(path: Path, bound: int | None = None, *, error: Refusal = SourceError) -> bytes:
    """Read a file whole, also a pipe; unpacked if its name ends in `.gz`."""
    with open_stream(path, error=error) as file:
        data = file.read() if bound is None else file.read(bound + 1)
    if bound is not None and len(data) > bound:
        message = f"{path}: expected at most {bound:,} bytes, found more"
        raise error(message, code="file-too-large", where=path)
    return data


def read_member(path: Path, name: str) -> bytes:
    """Read the one member of a zip that has a name, in whatever folder; nothing goes to disk."""
    with _refusing(path, SourceError, _ZIP_DAMAGE), zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        found = [member for member in names if PurePosixPath(member).name == name]
        if len(found) != 1:
            raise SourceError(
                f"{path}: expected {name} inside once, found it {len(found)} times among "
                f"{list_some(names, 5) or 'nothing'}",
                code="zip-member-missing",
                where=path,
            )
        return archive.read(found[0])


@contextmanager
def open_stream(path: Path, *, error: Refusal = SourceError) -> Iterator[BinaryIO]:
    """Open a file to read it piece by piece, unpacked if its name ends in `.gz`."""
    is_packed = path.name.casefold().endswith(PACKED)
    with _refusing(path, error), gzip.open(path) if is_packed else path.open("rb") as file:
        yield cast(BinaryIO, file)


def hash_file(path: Path) -> str:
    """Return the sha256 of the bytes of a file, in hexadecimal digits."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(2**20):
            digest.update(block)
    return digest.hexdigest()


@contextmanager
def _refusing(
    path: Path, error: Refusal, damage: tuple[type[Exception], ...] = _DAMAGE
) -> Iterator[None]:
    try:
        yield
    except BSGError:  # of whoever reads within the block; some are a ValueError, too
        raise
    except damage as fault:
        message = f"{path}: expected a whole file ({getattr(fault, 'strerror', None) or fault})"
        raise error(message, code="file-unreadable", where=path) from fault
