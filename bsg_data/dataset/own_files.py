"""Remove only files with the names that this program gives.

A file with any other name belongs to the user. It stays, and an error names it before anything else
is removed.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

from bsg_data.dataset.kept_maps import KEPT
from bsg_data.dataset.manifest import FILE_PATH, MANIFEST
from bsg_data.dataset.publication import (
    CARD,
    CROISSANT,
    PLAN,
    RECIPE,
    REPLACES,
    REPORTS,
    REVISION,
    list_paths,
)
from bsg_data.errors import DatasetError

_FIXED = {MANIFEST, CARD, CROISSANT, PLAN, RECIPE, REPLACES}
_STAGED = re.compile(rf"{re.escape(REVISION)}/(?:new|rest|old)/")
_NUMBERED = re.compile(
    rf"{re.escape(REPORTS)}/(?:part-[0-9]+\.json|parts-of-[0-9]+)|{KEPT}/[0-9a-f]{{12}}/[^/]+\.csv"
)
_UNFINISHED = re.compile(r"\.([^/]+)\.partial$")  # of a file that was being written


def is_own(path: str) -> bool:
    """Say whether a path below a dataset is a name that commands give.

    >>> is_own("pairs/train-00000.parquet"), is_own("rooms/.part-00000.parquet.partial")
    (True, True)
    >>> is_own("pairs/notes.txt"), is_own(".revision/notes.txt")
    (False, False)
    """
    path = _UNFINISHED.sub(r"\1", _STAGED.sub("", path))
    return path in _FIXED or bool(FILE_PATH.fullmatch(path) or _NUMBERED.fullmatch(path))


def list_foreign(folder: Path, *, below: str = ".") -> list[str]:
    """Return the sorted paths of files below a folder that no command of this program wrote."""
    return [path for path in list_paths(folder, below=below) if not is_own(path)]


def refuse_foreign(folder: Path, *, below: str = ".") -> None:
    """Refuse a folder that holds foreign files.

    Raises:
        DatasetError: naming the first foreign file.
    """
    if (folder / below).is_symlink():
        raise DatasetError(f"{folder / below}: cannot be removed: it is a link; remove it yourself")
    foreign = list_foreign(folder, below=below)
    if foreign:
        more = f" and {len(foreign) - 1:,} more" if len(foreign) > 1 else ""
        raise DatasetError(
            f"{folder}: holds {foreign[0]}{more}, which this program did not write; move it away, "
            "and run the command again"
        )


def remove_own(folder: Path, *, below: str = ".", last: Collection[str] = ()) -> None:
    """Remove a folder of this program, or a folder below it.

    Args:
        folder: root of all paths.
        below: the part of it to remove.
        last: paths of the files that identify the folder; they are removed last.

    Raises:
        DatasetError: if it holds foreign files (then nothing is removed), or a file cannot be
            removed.
    """
    refuse_foreign(folder, below=below)
    try:
        for path in sorted(list_paths(folder, below=below), key=lambda path: path in last):
            (folder / path).unlink()
        inner = (path for path in (folder / below).rglob("*") if path.is_dir())
        for empty in sorted(inner, key=lambda path: -len(path.parts)):
            empty.rmdir()
        if (folder / below).exists():
            (folder / below).rmdir()
    except OSError as error:
        where = error.filename or folder / below
        raise DatasetError(f"{where}: cannot be removed ({error.strerror or error})") from error
