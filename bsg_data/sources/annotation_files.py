"""Files of annotations: found below a folder, told apart by a hash."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.inputs.bounded_file import hash_bounded
from bsg_data.inputs.bounds import Bound
from bsg_data.sources.source import SkippedScene


def list_files(path: Path, suffixes: tuple[str, ...], unreadable: list[SkippedScene]) -> list[Path]:
    """Return a path that is such a file, or all such files below a folder.

    Args:
        path: of a file or a folder.
        suffixes: how the names end.
        unreadable: takes the folders and files that cannot be read, and why.

    Raises:
        SourceError: if nothing is there.
    """
    if path.is_file():
        return [path] if path.name.endswith(suffixes) else []
    if not path.is_dir():
        raise SourceError(f"{path}: no such file or folder")
    return list(walk_files(path, suffixes, unreadable))


def walk_files(
    root: Path, suffixes: tuple[str, ...], unreadable: list[SkippedScene]
) -> Iterator[Path]:
    """Yield the files below a folder whose names end so, through links but never round a loop.

    Args:
        root: the folder.
        suffixes: how the names end; hidden files are left out.
        unreadable: takes the folders and files that cannot be read, and why.
    """

    def note(error: OSError) -> None:
        where = Path(str(error.filename)).relative_to(root).as_posix()
        unreadable.append(SkippedScene("-", where, f"the folder cannot be read ({error.strerror})"))

    seen: set[Path] = set()
    for folder, folders, names in os.walk(root, followlinks=True, onerror=note):
        real = Path(folder).resolve()
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        folders.sort()
        for name in sorted(names):
            if name.endswith(suffixes) and not name.startswith("."):
                reason = _why_not(Path(folder, name))
                if reason is None:
                    yield Path(folder, name)
                else:
                    where = Path(folder, name).relative_to(root).as_posix()
                    shown = where.encode("utf-8", "backslashreplace").decode()
                    unreadable.append(SkippedScene("-", shown, reason))


def _why_not(path: Path) -> str | None:
    """Return why a path cannot be an annotation; None if it can."""
    if not path.is_file():  # a link that leads nowhere, a pipe, a device
        return "not a file, or a link that leads nowhere"
    if not str(path).isprintable() and any("\ud800" <= c <= "\udfff" for c in str(path)):
        return "its path is not UTF-8"
    return None


def fingerprint(path: Path, bound: Bound) -> str:
    """Hash a file; one that cannot be read, or is far too large, is reported when it is read."""
    try:
        return hash_bounded(path, bound)
    except OSError as error:
        return f"unreadable: {error.strerror}"
    except ValueError:
        return "too large"


def decode(data: bytes, *, path: Path) -> str:
    """Return UTF-8 text.

    Raises:
        AnnotationError: naming the first line that is none.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = data.count(b"\n", 0, error.start) + 1
        line = data.split(b"\n")[number - 1].decode("utf-8", "backslashreplace")
        raise AnnotationError(path, number, line, expected="UTF-8 text") from error
