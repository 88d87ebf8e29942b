"""Find files of annotations, and read them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, wraps
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

from pydantic import AfterValidator, BaseModel, ValidationError

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import (
    AnnotationError,
    BSGError,
    SourceChangedError,
    SourceError,
    find_io_error,
)
from bsg_data.inputs.bounded_file import PACKED, hash_file, read_bytes
from bsg_data.records import name_fault
from bsg_data.scene.scene_graph import is_scene_id
from bsg_data.sources.source import FoundScenes, SceneRef
from bsg_data.words.shown import list_some

_SHOWN = 120  # characters of a faulty line
_SHOWN_COLUMNS = 20  # in a note
# minival is part of val: a building in both is val's. The order decides which copy is kept.
SPLITS = ("train", "val", "test", "minival", "example")
_Read = TypeVar("_Read", bound=Callable[..., Any])
_Model = TypeVar("_Model", bound=BaseModel)


def _require_scene_id(name: str) -> str:
    if not is_scene_id(name):
        raise ValueError(f"expected a name that a file can have, found {name!r}")
    return name


SceneName = Annotated[str, AfterValidator(_require_scene_id)]


def find_files(path: Path, suffix: str, *, expected: str, is_path: bool = False) -> FoundScenes:
    """Find scenes of one file each, packed or not: a file, or all such files below a folder.

    A scene has the name of its file, after the folders above it, joined by `-`, if `is_path`.
    """
    files, unreadable = list_files(path, (suffix, suffix + PACKED), expected=expected)
    root = path if path.is_dir() else path.parent
    refs = []
    for file in files:
        location = file.relative_to(root)
        name = file.name.removesuffix(PACKED).removesuffix(suffix) or file.name
        scene_id = "-".join((*location.parts[:-1], name)) if is_path else name
        refs.append(SceneRef(scene_id, location.as_posix(), fingerprint(file)))
    found = keep_one_copy(
        refs, path=path, expected=expected, digest=lambda ref: hash_file(root / ref.location)
    )
    return replace(found, unreadable=unreadable)


def list_files(
    path: Path, suffixes: tuple[str, ...], *, expected: str
) -> tuple[list[Path], tuple[SkippedScene, ...]]:
    """Return the files below a folder, or the one file, with a suffix, and what cannot be read.

    Where there is none, the error says what was expected.
    """
    unreadable: list[SkippedScene] = []
    if path.is_dir():
        files = list(_walk(path, suffixes, unreadable))
    elif path.is_file():
        files = [path] if path.name.endswith(suffixes) else []
    else:
        raise SourceError(
            f"{path}: expected a file or a folder, found none", code="source-missing", where=path
        )
    if not files:
        left_out = [f"{skip.location} ({skip.reason})" for skip in unreadable]
        hint = f"; left out are {list_some(left_out, 1)}" if left_out else ""
        raise SourceError(f"{path}: {expected}{hint}", code="source-empty", where=path)
    return files, tuple(unreadable)


def _walk(root: Path, suffixes: tuple[str, ...], unreadable: list[SkippedScene]) -> Iterator[Path]:
    """Yield the files below a folder that are not hidden; follow links, but no loops."""

    def note(where: str, reason: str) -> None:
        shown = os.path.relpath(where, root)
        unreadable.append(SkippedScene(scene_id="-", location=shown, reason=reason))

    def fail(error: OSError) -> None:
        require_lasting(error, error.filename)
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
                path = Path(folder, name)
                if reason := _why_not(path):
                    note(str(path), reason)
                else:
                    yield path


def _why_not(path: Path) -> str | None:
    """Return why a path cannot be an annotation; None if it can."""
    try:
        if not path.is_file():  # a link that leads nowhere, a pipe, a device
            return "not a file, or a link that leads nowhere"
    except OSError as error:
        require_lasting(error, path)
        return f"cannot be read ({error.strerror})"
    return None


def require_lasting(error: BSGError | OSError, path: object) -> None:
    """Refuse to go on after an error of the disk, which may not be there at the next try."""
    if find_io_error(error):
        why = str(error) if isinstance(error, BSGError) else error.strerror
        raise SourceChangedError(
            f"{path}: cannot be read ({why})", code="source-changed", where=path
        ) from error


def keep_one_copy(
    refs: Sequence[SceneRef],
    *,
    path: Path,
    expected: str,
    digest: Callable[[SceneRef], str] = attrgetter("fingerprint"),
) -> FoundScenes:
    """Keep one scene of every building: numbered first, newest version, then split, then path.

    Scenes with the same digest are duplicates; other scenes of the same building are conflicts.
    Where there is none, the error names the source's path, and says what was expected there.
    """
    if not refs:
        raise SourceError(f"{path}: {expected}", code="source-empty", where=path)
    first_of: dict[str, SceneRef] = {}
    duplicates: list[SkippedScene] = []
    conflicts: list[SkippedScene] = []
    for ref in sorted(refs, key=_preference):
        first = first_of.setdefault(ref.key, ref)
        if first is not ref:
            is_same = digest(first) == digest(ref)
            what = "the same annotation" if is_same else "another annotation of the same building"
            skip = SkippedScene(ref.scene_id, ref.location, f"{first.location} has {what}")
            (duplicates if is_same else conflicts).append(skip)
    scenes = sorted(first_of.values(), key=lambda ref: ref.scene_id)
    return FoundScenes(
        tuple(scenes),
        duplicates=tuple(sorted(duplicates, key=lambda skip: skip.location)),
        conflicts=tuple(sorted(conflicts, key=lambda skip: skip.location)),
    )


def _preference(ref: SceneRef) -> tuple[bool, tuple[int, ...], int, str]:
    rank = SPLITS.index(ref.source_split) if ref.source_split in SPLITS else len(SPLITS)
    version = (ref.source_version or "v0.0").removeprefix("v").split(".")
    newest = tuple(-int(number) for number in version)
    return (ref.scene_id == ref.key, newest, rank, ref.location)


def fingerprint(path: Path) -> str:
    """Return the state of a file; one that cannot be read is reported when it is."""
    try:
        stat = path.stat()
    except OSError as error:
        require_lasting(error, path)
        return "unreadable"
    return f"{stat.st_size} bytes, changed at {stat.st_mtime_ns}"


def once_for_each_state(read: _Read) -> _Read:
    """Remember what was read of the last files, while their sizes and times of change stay."""

    @lru_cache(maxsize=2)
    def remember(path: Path, _: tuple[int, int], *options: Any) -> Any:
        return read(path, *options)

    @wraps(read)
    def read_again(path: Path, *options: Any) -> Any:
        return remember(path, state_of(path), *options)

    return cast(_Read, read_again)


def state_of(path: Path) -> tuple[int, int]:
    """Return the size of a file and when it changed."""
    try:
        stat = path.stat()
    except OSError as error:
        message = f"{path}: expected a file that can be read ({error.strerror})"
        raise SourceError(message, code="file-unreadable", where=path) from error
    return stat.st_size, stat.st_mtime_ns


def read_scene_file(root: Path, ref: SceneRef) -> tuple[Path, bytes]:
    """Return the file of a scene, below a root or that itself, and its bytes."""
    path = root if root.is_file() else root / ref.location
    return path, read_bytes(path)


def skip_columns(path: Path, columns: Sequence[str]) -> tuple[SkippedScene, ...]:
    """Return the note on the columns of a table that are not read, if there are any."""
    reason = f"columns that are not read: {list_some(columns, _SHOWN_COLUMNS)}"
    return (SkippedScene("all", path.name, reason),) if columns else ()


def malformed(path: Path, number: int, line: str, *, expected: str) -> AnnotationError:
    """Return an error that names a line of a file, and what it should have held."""
    where = f"{path}, line {number}"
    message = f"{where}: expected {expected}, found {show_line(line)}"
    return AnnotationError(message, code="line-malformed", where=where)


def show_line(line: str) -> str:
    """Return the beginning of a line in quotes, with the bytes that are no UTF-8 escaped."""
    shown = line if len(line) <= _SHOWN else line[: _SHOWN - 3] + "..."
    return repr(shown.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace"))


def validate(
    model: type[_Model], document: object, *, where: Path | str, expected: str, code: str
) -> _Model:
    """Return the record of a document; the error names the key of its first fault."""
    try:
        return model.model_validate(document)
    except ValidationError as error:
        message = f"{where}: expected {expected}; {name_fault(error)}"
        raise SourceError(message, code=code, where=where) from error


def decode(data: bytes, *, path: Path) -> str:
    """Return UTF-8 text; the error names the first line that is none."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = data.count(b"\n", 0, error.start) + 1
        line = data.split(b"\n", number)[number - 1].decode("utf-8", "backslashreplace")
        raise malformed(path, number, line, expected="UTF-8 text") from error
