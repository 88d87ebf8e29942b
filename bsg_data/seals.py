"""The seal of a folder of results: `SHA256SUMS`, the hashes of all its files, written last.

A folder with a seal is finished, and its files belong together. `sha256sum -c SHA256SUMS` checks it
as `bsg-models check` does. A folder from before there were seals has none, and nothing can be told
of it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import refuse_links, write_bytes
from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.bounds import CHECKSUMS
from bsg_data.result_folder import Place, hold_places, stage_files

SEAL = "SHA256SUMS"
_LINE = re.compile(r"(?P<sha256>[0-9a-f]{64})  (?P<name>(?!/)[^\\\x00-\x1f]+)")


@contextmanager
def replace_sealed(
    folder: Path,
    record: str,
    *,
    beside: Sequence[Place] = (),
    refuse: Callable[[], None] | None = None,
) -> Iterator[tuple[Path, ...]]:
    """Hold the lock of a folder, yield one to write into, and put its files in place, sealed.

    What the seal before listed and the new one does not is removed, unless somebody changed it; all
    other files stay. The new ones are put in place as `replace_together` does.

    Args:
        folder: of the results.
        record: the file that all results of this kind have and no others; it has to be written.
        beside: other places that change together with it.
        refuse: as of `replace_together`.

    Yields:
        the folder to write into, then where to write what goes to the other places.

    Raises:
        DatasetError: if another command is writing there, other results or somebody's own files are
            in the way, or a file cannot be written; what was there stays.
    """
    place = Place(folder.resolve(), last=SEAL)
    with ExitStack() as held:
        hold_places(held, [place, *beside])
        before: dict[str, str] = {}

        def look() -> None:
            before.update(require_kind(place.path, record))
            if refuse is not None:
                refuse()

        with stage_files([place, *beside], refuse=look) as staged:
            yield staged
            files = (path for path in staged[0].rglob("*") if path.is_file())
            names = sorted(path.relative_to(staged[0]).as_posix() for path in files)
            write_seal(staged[0], names)
            refuse_replacing(place.path, record, names)
        for name in before.keys() - set(names):
            with suppress(OSError, DatasetError):  # no seal speaks of what is behind a link
                refuse_links(place.path, place.path / name)
                if hash_file(place.path / name) == before[name]:
                    (place.path / name).unlink()


def require_kind(folder: Path, record: str) -> dict[str, str]:
    """Return the seal of a folder; of one that has none, or a damaged one, that of no files.

    Args:
        folder: of results, which need not be there.
        record: the file that all results of the wanted kind have and no others.

    Raises:
        DatasetError: if it is the seal of other results.
    """
    sums: dict[str, str] = {}
    with suppress(DatasetError):  # what a damaged seal lists is nobody's any more
        sums = read_seal(folder) or {}
    if sums and record not in sums:
        raise DatasetError(
            f"{folder}: holds other results: its {SEAL} lists {min(sums)} and no {record}; choose "
            "another folder"
        )
    return sums


def refuse_replacing(folder: Path, record: str, names: Iterable[str]) -> None:
    """Refuse to replace files of a folder that no results of the same kind list.

    Args:
        folder: of results, which need not be there.
        record: as of `require_kind`; results that have it and no seal may be older than seals.
        names: of the files to be replaced, the seal aside.

    Raises:
        DatasetError: naming such a file, or if the folder holds other results.
    """
    before = require_kind(folder, record)
    if not before and (folder / record).is_file():
        return
    for name in sorted({*names} - before.keys() if before else {*names, SEAL}):
        if (folder / name).is_symlink() or (folder / name).exists():
            raise DatasetError(
                f"{folder / name}: belongs to no results of this command, which would replace it; "
                "move it away, or choose another folder"
            )


def write_seal(folder: Path, names: Iterable[str]) -> None:
    """Write the seal of some files of a folder.

    Raises:
        DatasetError: if one cannot be read, or the seal cannot be written.
    """
    try:
        lines = [f"{hash_file(folder / name)}  {name}\n" for name in names]
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be sealed ({error})") from error
    write_bytes(folder / SEAL, "".join(lines).encode())


def read_seal(folder: Path) -> dict[str, str] | None:
    """Return file → sha256 of the seal of a folder; None if it has none.

    Raises:
        DatasetError: naming the line that is none.
    """
    path = folder / SEAL
    if not path.is_symlink() and not path.exists():
        return None
    data = read_bytes(path, CHECKSUMS, error=DatasetError)
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise DatasetError(f"{path}: is damaged: no text ({error})") from error
    if not text.endswith("\n"):
        raise DatasetError(f"{path}: is damaged: its last line has no end")
    sums = {}
    for number, line in enumerate(text[:-1].split("\n"), 1):
        found = _LINE.fullmatch(line)
        if found is None or ".." in found["name"].split("/") or found["name"] in sums:
            raise DatasetError(
                f"{path}, line {number}: expected a sha256, two spaces and the name of a file in "
                f"the folder, each file once; found {line[:120]!r}"
            )
        sums[found["name"]] = found["sha256"]
    return sums


def require_seal(folder: Path) -> dict[str, str] | None:
    """Refuse a folder that is not what its seal says; return the seal, None if it has none.

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
            raise DatasetError(
                f"{path}: is in {SEAL} but cannot be read ({error.strerror or error})"
            ) from error
        if found != expected:
            raise DatasetError(
                f"{path}: was changed: expected sha256 {expected[:12]}… by {SEAL}, found "
                f"{found[:12]}…; take another copy, or make it again"
            )
    return sums
