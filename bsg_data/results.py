"""Results that belong together: written aside, put in place at once, and sealed by `SHA256SUMS`.

    while files are written   the old results, and `.bsg-unfinished` beside them
    while files are renamed   no seal, so that no mix of old and new is taken for results
    in the end                the new results, and their seal, written last

A folder without a seal is unfinished. `sha256sum -c SHA256SUMS` and `bsg-models verify` check it.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import flush_file, flush_folder, hold, refuse_links, resolve_links, write_bytes
from bsg_data.inputs.bounded_file import hash_file

SEAL = "SHA256SUMS"
UNFINISHED = ".bsg-unfinished"
_DATASET = "dataset.json"  # the file by which a dataset is known
_LINE = re.compile(r"(?P<sha256>[0-9a-f]{64})  (?P<name>(?!/)[^\\\x00-\x1f]+)")


@contextmanager
def write_results(folder: Path, *, report: str, force: bool = True) -> Iterator[Path]:
    """Yield an empty folder to write into, and put its files in place with a seal.

    Files of the old seal that are not written again are removed. All other files stay.

    Args:
        folder: of the results; one with another kind of results is refused.
        report: name of the file that marks this kind of results.
        force: whether old results are replaced.
    """
    folder = resolve_links(folder)
    refuse_other_results(folder, report)
    _refuse_taken(folder / report, force=force)
    was_killed = (folder / UNFINISHED).is_dir()  # then files without a seal are its own
    with _staging(folder) as staged:
        before = _list_sealed(folder)
        yield staged
        names = list_files(staged)
        new = {*names, SEAL} - {*before, *([SEAL] if before else [])}
        for name in () if was_killed else sorted(new):
            if (folder / name).is_symlink() or (folder / name).exists():
                raise DatasetError(
                    f"{folder / name}: belongs to no results of this command, but would be "
                    "replaced; move it away, or choose another folder",
                    code="path-taken",
                    where=folder / name,
                )
        write_seal(staged, names)
        put_in_place(folder, leaving=before.keys() - names)


@contextmanager
def write_together(folder: Path) -> Iterator[Path]:
    """Lock a folder, yield an empty folder to write into, and put its files in place at the end."""
    with _staging(folder) as staged:
        yield staged
        put_in_place(folder)


@contextmanager
def _staging(folder: Path) -> Iterator[Path]:
    """Lock a folder, which is created, and yield an empty folder in it, which is removed."""
    refuse_datasets(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with hold(folder):
            is_new, staged = not folder.exists(), folder / UNFINISHED
            remove_unfinished(folder)
            staged.mkdir(parents=True)
            try:
                yield staged
            finally:
                with suppress(OSError):
                    remove_unfinished(folder)
                    if is_new:
                        folder.rmdir()  # unless anything is in it
    except OSError as error:
        message = f"{folder}: cannot be written ({error.strerror or error})"
        raise DatasetError(message, code="not-written", where=folder) from error


def put_in_place(folder: Path, *, leaving: Collection[str] = ()) -> None:
    """Move all files of `UNFINISHED` into the folder, the seal last, and remove others."""
    staged = folder / UNFINISHED
    names = sorted(list_files(staged), key=lambda name: name == SEAL)
    for name in names:
        refuse_links(folder, (folder / name).parent)
        flush_file(staged / name)
    (folder / SEAL).unlink(missing_ok=True)
    flush_folder(folder)
    for name in leaving:
        (folder / name).unlink(missing_ok=True)
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if name == SEAL:
            flush_folder(folder)
        (staged / name).replace(folder / name)
    for parent in {(folder / name).parent for name in names}:
        flush_folder(parent)


def remove_unfinished(folder: Path) -> None:
    """Remove what a command left unfinished; a link there leads to nothing of ours."""
    staged = folder / UNFINISHED
    if staged.is_symlink():
        raise DatasetError(f"{staged}: is a link; remove it", code="link", where=staged)
    if staged.exists():
        shutil.rmtree(staged)


def list_files(folder: Path) -> list[str]:
    """Return the sorted relative paths of all files below a folder."""
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir())


def refuse_datasets(path: Path) -> None:
    """Refuse to write into a dataset, because a dataset lists and hashes all its files.

    Call this before anything is written, also before a lock: its file lies beside the folder.
    """
    place = resolve_links(path)
    for outer in (place, *place.parents):
        if (outer / _DATASET).is_file():
            message = f"{path}: is in the dataset {outer}; choose another place"
            raise DatasetError(message, code="inside-dataset", where=path)


def refuse_file(path: Path, *, force: bool) -> None:
    """Refuse to write a file into a dataset, over sealed results, or, without `force`, at all."""
    refuse_datasets(path)
    place = resolve_links(path.parent) / path.name  # a link to the folder leads to the same file
    for folder in place.parents:
        if place.name == SEAL or place.relative_to(folder).as_posix() in _list_sealed(folder):
            raise DatasetError(
                f"{path}: is one of the results that {SEAL} lists in {folder}; name another file",
                code="sealed-file",
                where=path,
            )
    _refuse_taken(path, force=force)


def _refuse_taken(path: Path, *, force: bool) -> None:
    if path.exists() and not force:
        message = f"{path}: is there already; --force replaces it"
        raise DatasetError(message, code="path-taken", where=path)


def refuse_other_results(folder: Path, report: str) -> None:
    """Refuse a folder with results of another kind, which would lose their seal."""
    sealed = _list_sealed(folder)
    if sealed and report not in sealed:
        raise DatasetError(
            f"{folder}: holds other results ({min(sealed)}), which would become incomplete; choose "
            "another folder",
            code="other-results",
            where=folder,
        )


def _list_sealed(folder: Path) -> dict[str, str]:
    """Return the files that the seal of a folder lists; empty for a damaged seal."""
    try:
        return read_seal(folder) or {}
    except DatasetError:
        return {}


def write_seal(folder: Path, names: Iterable[str]) -> None:
    """Write the seal of some files of a folder."""
    lines = [f"{hash_file(folder / name)}  {name}\n" for name in names]
    write_bytes(folder / SEAL, "".join(lines).encode())


def read_seal(folder: Path) -> dict[str, str] | None:
    """Return file → sha256 of the seal of a folder; None if it has none."""
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
    """Check a folder against its seal and return the seal; None if it has none."""
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
