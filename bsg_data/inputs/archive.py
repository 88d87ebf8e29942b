"""Read members of an untrusted zip within a bound; nothing is unpacked to disk."""

from __future__ import annotations

import lzma
import os
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import Refusal, open_waiting_for_none
from bsg_data.inputs.bounds import MAX_MEMBERS, Bound


def read_member(path: Path, name: str, bound: Bound, *, error: Refusal = SourceError) -> bytes:
    """Read the one member of a zip that has a name, in whatever folder of it.

    Args:
        path: of the zip.
        name: of the file, without a folder.
        bound: of the zip, and of what the member unpacks to.
        error: makes what is raised of a message.

    Raises:
        SourceError: or what `error` makes, if the zip cannot be read, is damaged or encrypted, has
            a member that leads out of it or a name twice, or unpacks to more than the bound.
    """
    with _open(path, bound, error) as archive:
        members = archive.infolist()
        _require_plain(members, path, error)
        found = [one for one in members if PurePosixPath(one.filename).name == name]
        if len(found) != 1:
            held = ", ".join(one.filename for one in members[:5]) or "nothing"
            raise error(
                f"{path}: expected {name} inside, found {held}"
                if not found
                else f"{path}: expected {name} inside once, found it in {len(found)} folders"
            )
        with archive.open(found[0]) as member:
            return _take(member, bound, f"{path}: {name}", error)


def _take(member: IO[bytes], bound: Bound, where: str, error: Refusal) -> bytes:
    """Return what a member unpacks to, whatever size it declares."""
    pieces, left = [], bound.bytes
    while piece := member.read(2**16):
        left -= len(piece)
        if left < 0:
            raise error(f"{where}: unpacks to more than {bound.bytes:,} bytes")
        pieces.append(piece)
    return b"".join(pieces)


@contextmanager
def _open(path: Path, bound: Bound, error: Refusal) -> Iterator[zipfile.ZipFile]:
    try:
        with open_waiting_for_none(path) as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise error(f"{path}: is no file that can be read as a zip")
            if found.st_size > bound.bytes:
                raise error(f"{path}: {found.st_size:,} bytes; expected at most {bound.bytes:,}")
            with zipfile.ZipFile(file) as archive:
                yield archive
    except OSError as fault:
        raise error(f"{path}: cannot be read ({fault.strerror or fault})") from fault
    except (
        zipfile.BadZipFile,
        zlib.error,
        lzma.LZMAError,
        RuntimeError,
        EOFError,
        ValueError,
        OverflowError,
    ) as fault:
        if isinstance(fault, UnicodeDecodeError):
            raise error(f"{path}: not a readable zip file (a name that is no text)") from fault
        raise error(f"{path}: not a readable zip file ({fault})") from fault


def _require_plain(members: list[zipfile.ZipInfo], path: Path, error: Refusal) -> None:
    if len(members) > MAX_MEMBERS:
        raise error(f"{path}: {len(members):,} members; expected at most {MAX_MEMBERS:,}")
    seen: set[str] = set()
    for one in members:
        name = PurePosixPath(one.filename.replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or stat.S_ISLNK(one.external_attr >> 16):
            raise error(f"{path}: the member {one.filename!r} leads out of the zip")
        if one.filename in seen:
            raise error(f"{path}: two members are called {one.filename!r}; expected each name once")
        seen.add(one.filename)
