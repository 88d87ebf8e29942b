"""Find files of annotations, and read them as they were when they were listed."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from bsg_data.errors import AnnotationError, SourceChangedError, SourceError, find_io_error
from bsg_data.inputs.bounded_file import PACKED, TooLargeError, hash_file, read_packed, unpack
from bsg_data.inputs.bounds import Bound
from bsg_data.sources.hm3d_names import keep_one_copy
from bsg_data.sources.source import FoundScenes, SceneRef, SkippedScene

TOO_LARGE = "too large"
_SHOWN = 120  # characters of a faulty line
Content = TypeVar("Content")


def find_files(
    path: Path, suffix: str, *, bound: Bound, expected: str, is_path: bool = False
) -> FoundScenes:
    """Find scenes of one file each, packed or not: a file, or all such files below a folder.

    A scene has the name of its file; `location` is its path below the folder.

    Args:
        path: of a file or a folder.
        suffix: how the names end; `.gz` may follow.
        bound: of each file.
        expected: what is said if there is none.
        is_path: whether the folders of the path are in the name, joined by `-`.
    """
    unreadable: list[SkippedScene] = []
    suffixes = (suffix, suffix + PACKED)
    root = path if path.is_dir() else path.parent
    if path.is_file():
        files = [path] if path.name.endswith(suffixes) else []
    elif path.is_dir():
        files = list(walk_files(path, suffixes, unreadable))
    else:
        raise SourceError(f"{path}: no such file or folder", code="source-missing", where=path)
    if not files:
        refuse_unreadable(path, unreadable)
        raise SourceError(f"{path}: {expected}", code="source-empty", where=path)
    refs = [
        SceneRef(
            scene_id=_name_scene(file, root if is_path else file.parent, suffix),
            location=file.relative_to(root).as_posix(),
            fingerprint=fingerprint(file, bound),
            source_split=None,
            source_version=None,
        )
        for file in files
    ]
    return replace(keep_one_copy(refs), unreadable=tuple(unreadable))


def _name_scene(file: Path, root: Path, suffix: str) -> str:
    name = file.name.removesuffix(PACKED).removesuffix(suffix) or file.name
    return "-".join((*file.relative_to(root).parts[:-1], name))


def walk_files(
    root: Path, suffixes: tuple[str, ...], unreadable: list[SkippedScene]
) -> Iterator[Path]:
    """Yield the files below a folder with certain suffixes; follow links, but no loops.

    Args:
        root: the folder.
        suffixes: suffixes of the names; hidden files are left out.
        unreadable: collects the unreadable folders and files, with the reasons.
    """

    def note(where: str, reason: str) -> None:
        shown = os.path.relpath(where, root).encode("utf-8", "backslashreplace").decode()
        unreadable.append(SkippedScene(scene_id="-", location=shown, reason=reason))

    def fail(error: OSError) -> None:
        _require_lasting(error, error.filename)
        note(error.filename, f"the folder cannot be read ({error.strerror})")

    seen: set[Path] = set()
    for folder, folders, names in os.walk(root, followlinks=True, onerror=fail):
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
                    note(str(Path(folder, name)), reason)


def _why_not(path: Path) -> str | None:
    """Return why a path cannot be an annotation; None if it can."""
    try:
        if not path.is_file():  # a link that leads nowhere, a pipe, a device
            return "not a file, or a link that leads nowhere"
    except OSError as error:
        _require_lasting(error, path)
        return f"cannot be read ({error.strerror})"
    if any("\ud800" <= c <= "\udfff" for c in str(path)):
        return "its path is not UTF-8"
    return None


def _require_lasting(error: OSError, path: object) -> None:
    """Refuse to go on after an error of the disk, which may not be there at the next try."""
    if find_io_error(error):
        raise SourceChangedError(
            f"{path}: cannot be read ({error.strerror})", code="source-changed", where=path
        ) from error


def refuse_unreadable(root: Path, unreadable: Sequence[SkippedScene]) -> None:
    """Refuse a folder in which nothing that was found can be read; there may be nothing."""
    if unreadable:
        first = unreadable[0]
        shown = os.fsencode(root).decode("utf-8", "backslashreplace")
        raise SourceError(
            f"{shown}: nothing there can be read; left out are {first.location} ({first.reason}) "
            f"and {len(unreadable) - 1:,} more; rename them or the folders above, or make them "
            "readable",
            code="source-unreadable",
            where=shown,
        )


def fingerprint(path: Path, bound: Bound) -> str:
    """Hash a file; a forbidden or far too large file is reported later, when it is read."""
    try:
        return hash_file(path, bound)
    except TooLargeError:
        return TOO_LARGE
    except OSError as error:
        _require_lasting(error, path)
        return f"unreadable: {error.strerror}"


def read_listed(path: Path, bound: Bound, *, expected: str | None = None) -> bytes:
    """Read a file that was listed, unpacked if its name ends in `.gz`.

    Args:
        path: of the file.
        bound: that it must keep, packed and unpacked.
        expected: its fingerprint when it was listed, which these very bytes must have.
    """
    try:
        data = read_packed(path, bound)
    except SourceError as error:
        cause = error.__cause__
        found = f"unreadable: {cause.strerror}" if isinstance(cause, OSError) else TOO_LARGE
        require_fingerprint(path, found, expected)
        raise
    require_fingerprint(path, hashlib.sha256(data).hexdigest(), expected)
    return unpack(data, path, bound)


def fetch_listed(
    ref: SceneRef, path: Path, read: Callable[[], Content], digest: Callable[[Content], str]
) -> Content:
    """Return what a file of many scenes says of one, which must be what was listed.

    Args:
        ref: the scene, as it was listed.
        path: of the file, named in errors.
        read: reads the scene; it could when the scenes were listed.
        digest: hashes what is read.
    """
    where = f"{path}: {ref.location}"
    try:
        content = read()
    except (SourceError, KeyError) as error:
        raise SourceChangedError(
            f"{where}: changed after the scenes were listed: {error}",
            code="source-changed",
            where=where,
        ) from error
    require_fingerprint(where, digest(content), ref.fingerprint)
    return content


def require_fingerprint(path: Path | str, found: str, expected: str | None) -> None:
    """Refuse a file that changed after it was listed.

    Args:
        path: path for the error.
        found: fingerprint of the file now.
        expected: fingerprint when it was listed; None if it was not listed.
    """
    if expected is not None and found != expected:
        why = f" ({found})" if found.startswith("unreadable") else ""
        raise SourceChangedError(
            f"{path}: changed after the scenes were listed{why}", code="source-changed", where=path
        )


def malformed(path: Path, number: int, line: str, *, expected: str) -> AnnotationError:
    """Return an error that names a line of a file, and what it should have held."""
    shown = line if len(line) <= _SHOWN else line[: _SHOWN - 3] + "..."
    where = f"{path}, line {number}"
    return AnnotationError(
        f"{where}: expected {expected}, found {shown!r}", code="line-malformed", where=where
    )


def decode(data: bytes, *, path: Path) -> str:
    """Return UTF-8 text."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = data.count(b"\n", 0, error.start) + 1
        line = data.split(b"\n")[number - 1].decode("utf-8", "backslashreplace")
        raise malformed(path, number, line, expected="UTF-8 text") from error
