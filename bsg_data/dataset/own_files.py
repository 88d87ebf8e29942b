"""What may be removed in a folder of ours: files with the names that commands give, and no other.

Whatever has another name is a user's. It stays, and is named, before anything beside it goes.
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
    """Say whether commands give such a name to a file, by its path below a dataset.

    >>> is_own("pairs/train-00000.parquet"), is_own("rooms/.part-00000.parquet.partial")
    (True, True)
    >>> is_own("pairs/notes.txt"), is_own(".revision/notes.txt")
    (False, False)
    """
    path = _UNFINISHED.sub(r"\1", _STAGED.sub("", path))
    return path in _FIXED or bool(FILE_PATH.fullmatch(path) or _NUMBERED.fullmatch(path))


def list_foreign(folder: Path, *, below: str = ".") -> list[str]:
    """Return the paths, from a folder on, of what no command of ours has put there, sorted."""
    return [path for path in list_paths(folder, below=below) if not is_own(path)]


def refuse_foreign(folder: Path, *, below: str = ".") -> None:
    """Refuse a folder that is ours and holds something which is not.

    Raises:
        DatasetError: naming it.
    """
    if (folder / below).is_symlink():
        raise DatasetError(f"{folder / below}: cannot be removed: it is a link; remove it yourself")
    foreign = list_foreign(folder, below=below)
    if foreign:
        more = f" and {len(foreign) - 1:,} more" if len(foreign) > 1 else ""
        raise DatasetError(
            f"{folder}: holds {foreign[0]}{more}, which no command of ours made; move it away, "
            "and run the command again"
        )


def remove_own(folder: Path, *, below: str = ".", last: Collection[str] = ()) -> None:
    """Remove a folder of ours, or one that is below it.

    Args:
        folder: from which on paths are.
        below: what to remove of it.
        last: paths of the files that say what the folder is: they go after all others, so that it
            can be told to the end.

    Raises:
        DatasetError: if something is in it that is not ours, before anything is removed, or if a
            file cannot be removed.
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
