"""Read one member of a zip within a bound; nothing is unpacked to disk."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path, PurePosixPath

from bsg_data.errors import SourceError
from bsg_data.inputs.bounds import Bound


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
