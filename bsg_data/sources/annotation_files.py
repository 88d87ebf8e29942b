"""Find files of annotations below a folder, and detect changes by a hash."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from bsg_data.errors import AnnotationError, SourceChangedError, SourceError, find_io_error
from bsg_data.inputs.bounded_file import TooLargeError, hash_file, read_packed, unpack
from bsg_data.inputs.bounds import Bound
from bsg_data.sources.source import SkippedScene

TOO_LARGE = "too large"


def list_files(path: Path, suffixes: tuple[str, ...], unreadable: list[SkippedScene]) -> list[Path]:
    """Return a file with one of the suffixes, or all such files below a folder.

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
    """Yield the files below a folder with certain suffixes; follow links, but no loops.

    Args:
        root: the folder.
        suffixes: suffixes of the names; hidden files are left out.
        unreadable: collects the unreadable folders and files, with the reasons.
    """

    def note(error: OSError) -> None:
        if find_io_error(error):
            raise SourceChangedError(f"{error.filename}: cannot be read ({error.strerror})")
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
    try:
        if not path.is_file():  # a link that leads nowhere, a pipe, a device
            return "not a file, or a link that leads nowhere"
    except OSError as error:
        if find_io_error(error):
            raise SourceChangedError(f"{path}: cannot be read ({error.strerror})") from error
        return f"cannot be read ({error.strerror})"
    if not str(path).isprintable() and any("\ud800" <= c <= "\udfff" for c in str(path)):
        return "its path is not UTF-8"
    return None


def refuse_unreadable(root: Path, unreadable: Sequence[SkippedScene]) -> None:
    """Refuse a folder in which nothing that was found can be read; there may be nothing.

    Args:
        root: the folder.
        unreadable: what cannot be read, as `walk_files` collects it.

    Raises:
        SourceError: naming the first, and why it cannot be read.
    """
    if unreadable:
        first = unreadable[0]
        more = f" and {len(unreadable) - 1:,} more" if len(unreadable) > 1 else ""
        shown = os.fsencode(root).decode("utf-8", "backslashreplace")
        raise SourceError(
            f"{shown}: nothing there can be read; left out are {first.location} ({first.reason})"
            f"{more}; rename them or the folders above, or make them readable"
        )


def fingerprint(path: Path, bound: Bound) -> str:
    """Hash a file; a forbidden or far too large file is reported later, when it is read.

    Raises:
        SourceChangedError: if the file is missing or temporarily unreadable.
    """
    try:
        return hash_file(path, bound)
    except TooLargeError:
        return TOO_LARGE
    except OSError as error:
        if find_io_error(error):
            raise SourceChangedError(f"{path}: cannot be read ({error.strerror})") from error
        return f"unreadable: {error.strerror}"


def read_listed(path: Path, bound: Bound, *, expected: str | None = None) -> bytes:
    """Read a file that was listed, unpacked if its name ends in `.gz`.

    Args:
        path: of the file.
        bound: that it must keep, packed and unpacked.
        expected: its fingerprint when it was listed, which these very bytes must have.

    Raises:
        SourceError: if it cannot be read, is no gzip though its name says so, or is larger.
        SourceChangedError: if it is not what it was when it was listed.
    """
    try:
        data = read_packed(path, bound)
    except SourceError as error:
        cause = error.__cause__
        found = f"unreadable: {cause.strerror}" if isinstance(cause, OSError) else TOO_LARGE
        require_fingerprint(path, found, expected)
        raise
    if expected is not None:
        require_fingerprint(path, hashlib.sha256(data).hexdigest(), expected)
    return unpack(data, path, bound)


def require_fingerprint(path: Path | str, found: str, expected: str | None) -> None:
    """Refuse a file that changed after it was listed.

    Args:
        path: path for the error.
        found: fingerprint of the file now.
        expected: fingerprint when it was listed; None if it was not listed.

    Raises:
        SourceChangedError: if the two differ.
    """
    if expected is not None and found != expected:
        why = f" ({found})" if found.startswith("unreadable") else ""
        raise SourceChangedError(f"{path}: changed after the scenes were listed{why}")


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
