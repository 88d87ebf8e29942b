"""The seal of a folder of results: `SHA256SUMS`, the hashes of all its files, written last.

A folder with a seal is finished, and its files belong together. `sha256sum -c SHA256SUMS` and
`bsg-models check` both check it. A folder without it is unfinished.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import refuse_links, resolve_links, write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.result_folder import UNFINISHED, Place, replace_together

SEAL = "SHA256SUMS"
_LINE = re.compile(r"(?P<sha256>[0-9a-f]{64})  (?P<name>(?!/)[^\\\x00-\x1f]+)")


@contextmanager
def replace_sealed(
    folder: Path,
    *,
    report: str,
    beside: Sequence[Place] = (),
    refuse: Callable[[], None] | None = None,
) -> Iterator[tuple[Path, ...]]:
    """Lock a folder, yield an empty folder to write into, and put its files in place with a seal.

    Files of the old seal that are not in the new one are removed, unless somebody changed them. All
    other files stay.

    Args:
        folder: folder of the results; a folder with another kind of results is refused.
        report: name of the file that marks this kind of results.
        beside: other places that change together with the folder.
        refuse: as in `replace_together`.

    Yields:
        The folder to write into, then the paths to write for the other places.

    Raises:
        DatasetError: if another command is writing there, other results or somebody's own files
            are, a file beside them is one of them, or one cannot be written; what was there stays.
    """
    place = Place(resolve_links(folder), last=SEAL)
    before: dict[str, str] = {}
    names: list[str] = []
    was_killed = (place.path / UNFINISHED).is_dir()  # then files without a seal are its own

    def look() -> None:
        refuse_other_results(place.path, report)
        for other in beside:
            if other.is_file:
                refuse_sealed_file(other.path)
        before.update(_list_sealed(place.path))
        if refuse is not None:
            refuse()

    def list_leaving() -> list[str]:
        gone = (name for name in before if name not in names)
        return [name for name in gone if _is_unchanged(place.path, name, before[name])]

    with replace_together([place, *beside], refuse=look, leaving=list_leaving) as staged:
        yield staged
        files = (path for path in staged[0].rglob("*") if path.is_file())
        names += sorted(path.relative_to(staged[0]).as_posix() for path in files)
        for other in beside:
            _refuse_twice(other, place.path, names)
        write_seal(staged[0], names)
        if not was_killed:
            refuse_replacing(place.path, report, names)


def _is_unchanged(folder: Path, name: str, sha256: str) -> bool:
    """Say whether a file is what its seal says; no seal speaks of what is behind a link."""
    with suppress(OSError, DatasetError):
        refuse_links(folder, folder / name)
        return hash_file(folder / name) == sha256
    return False


def refuse_other_results(folder: Path, report: str) -> None:
    """Refuse a folder with results of another kind: they would lose their seal.

    Args:
        folder: folder for the results.
        report: the file that is among all results of their kind, and of no other.

    Raises:
        DatasetError: naming what is there.
    """
    sealed = _list_sealed(folder)
    if sealed and report not in sealed:
        raise DatasetError(
            f"{folder}: holds other results ({min(sealed)}), which would become incomplete; choose "
            "another folder",
            code="other-results",
            where=folder,
        )


def refuse_sealed_file(path: Path) -> None:
    """Refuse to replace a file that belongs to sealed results.

    Raises:
        DatasetError: if the file is a seal, or if the seal of a folder above lists it.
    """
    place = resolve_links(path.parent) / path.name  # a link to the folder leads to the same file
    for folder in place.parents:
        if place.name == SEAL or place.relative_to(folder).as_posix() in _list_sealed(folder):
            raise DatasetError(
                f"{path}: is one of the results that {SEAL} lists in {folder}; name another file",
                code="sealed-file",
                where=path,
            )


def _list_sealed(folder: Path) -> dict[str, str]:
    """Return the files that the seal of a folder lists; empty for a damaged seal."""
    try:
        return read_seal(folder) or {}
    except DatasetError:
        return {}


def refuse_replacing(folder: Path, report: str, names: Iterable[str]) -> None:
    """Refuse to replace files that do not belong to results of the same kind.

    Raises:
        DatasetError: naming such a file.
    """
    before = _list_sealed(folder)
    for name in sorted({*names} - before.keys() if report in before else {*names, SEAL}):
        if (folder / name).is_symlink() or (folder / name).exists():
            raise DatasetError(
                f"{folder / name}: belongs to no results of this command, but would be replaced; "
                "move it away, or choose another folder",
                code="path-taken",
                where=folder / name,
            )


def _refuse_twice(other: Place, folder: Path, names: Sequence[str]) -> None:
    """Refuse a file beside results that goes where one of them goes."""
    path = resolve_links(other.path)
    if other.is_file and path.parent == folder and path.name in names:
        message = f"{other.path}: is one of the results themselves; name another file"
        raise DatasetError(message, code="sealed-file", where=other.path)


def write_seal(folder: Path, names: Iterable[str]) -> None:
    """Write the seal of some files of a folder.

    Raises:
        DatasetError: if one cannot be read, or the seal cannot be written.
    """
    try:
        lines = [f"{hash_file(folder / name)}  {name}\n" for name in names]
    except OSError as error:
        message = f"{folder}: cannot be sealed ({error})"
        raise DatasetError(message, code="not-written", where=folder) from error
    write_bytes(folder / SEAL, "".join(lines).encode())


def read_seal(folder: Path) -> dict[str, str] | None:
    """Return file → sha256 of the seal of a folder; None if it has none.

    Raises:
        DatasetError: naming the line that is none.
    """
    path = folder / SEAL
    if not path.is_file():
        return None
    sums: dict[str, str] = {}
    for number, line in enumerate(path.read_bytes().decode("utf-8", "replace").splitlines(), 1):
        found = _LINE.fullmatch(line)
        if found is None or ".." in found["name"].split("/") or found["name"] in sums:
            raise DatasetError(
                f"{path}, line {number}: expected a sha256, two spaces and the name of a file in "
                f"the folder, with each file once; found {line[:120]!r}",
                code="seal-line",
                where=f"{path}, line {number}",
            )
        sums[found["name"]] = found["sha256"]
    return sums


def require_seal(folder: Path) -> dict[str, str] | None:
    """Check a folder against its seal and return the seal; None if it has none.

    Raises:
        DatasetError: naming the first file that is missing or was changed.
    """
    sums = read_seal(folder)
    for name, expected in (sums or {}).items():
        path = folder / name
        try:
            refuse_links(folder, path)
            found = hash_file(path)
        except OSError as error:
            message = f"{path}: is in {SEAL} but cannot be read ({error.strerror or error})"
            raise DatasetError(message, code="file-missing", where=path) from error
        if found != expected:
            raise DatasetError(
                f"{path}: was changed: expected sha256 {expected[:12]}… by {SEAL}, found "
                f"{found[:12]}…; take another copy, or make it again",
                code="file-changed",
                where=path,
            )
    return sums
