"""Put a finished dataset in its place, and remove the old one only after that.

The two change places in one step where the system can do that, and by two renames elsewhere. A
command that is killed in between leaves one of these, which `settle` brings to its end:

    DATASET  DATASET.partial     .DATASET.replaced
    old      new
    new      old                                    exchanged
             new                 old                where nothing can be exchanged
    new                          old

The new dataset keeps its `.reports` until the old one is gone. They say which one that is.
"""

from __future__ import annotations

from pathlib import Path

from bsg_data.dataset.manifest import MANIFEST, hash_manifest
from bsg_data.dataset.own_files import remove_own
from bsg_data.dataset.publication import RECIPE, REPLACES, REPORTS, list_paths
from bsg_data.errors import DatasetError
from bsg_data.exchange import exchange
from bsg_data.files import flush_folder, resolve_links, write_bytes
from bsg_data.inputs.bounded_file import TooLargeError, read_bytes
from bsg_data.inputs.bounds import MANIFEST_FILE
from bsg_data.signals import hold_signals


def name_growing(out: Path) -> Path:
    """Return the folder that a dataset grows in."""
    place = _find_place(out)
    return place.with_name(f"{place.name}.partial")


def name_replaced(out: Path) -> Path:
    """Return where an old dataset is until it is removed."""
    place = _find_place(out)
    return place.with_name(f".{place.name}.replaced")


def _find_place(out: Path) -> Path:
    """Return where a dataset is that is named `.`, `..` or by a link; a link stays a link."""
    place = resolve_links(out)
    if not place.name:
        raise DatasetError(f"{out}: cannot be a dataset; choose a folder below it")
    return place


def put_in_place(out: Path) -> None:
    """Rename the finished dataset to its final path, then remove the dataset it replaces.

    Ctrl-C and SIGTERM wait until both are done.

    Raises:
        DatasetError: if it cannot be put there, or what was there cannot be removed.
    """
    with hold_signals():
        _rename(out)
        settle(out)


def _rename(out: Path) -> None:
    out, growing, replaced = _find_place(out), name_growing(out), name_replaced(out)
    try:
        for folder in (*filter(Path.is_dir, growing.iterdir()), growing):
            flush_folder(folder)  # the names in it, before the dataset gets its own
        if (out / MANIFEST).is_file():
            if replaced.exists() or replaced.is_symlink():
                raise DatasetError(f"{replaced}: is in the way; move it away, and run again")
            write_bytes(growing / REPLACES, hash_manifest(out).encode())
            if not exchange(growing, out):
                out.rename(replaced)
                _rename_or_put_back(growing, out, replaced)
        else:
            growing.rename(out)
        flush_folder(out.parent)
    except OSError as error:
        raise DatasetError(
            f"{out}: cannot be put in place ({error.strerror or error}); "
            f"the finished dataset is {growing}"
        ) from error


def restore(out: Path) -> None:
    """Restore a dataset that a killed command moved away to put another in its place.

    Raises:
        DatasetError: if it cannot be put there.
    """
    out, growing, replaced = _find_place(out), name_growing(out), name_replaced(out)
    try:
        if not out.exists() and _is_replaced(replaced, by=growing):
            growing.rename(out)
        if _is_replaced(growing, by=out) and not (growing / RECIPE).exists():
            growing.rename(replaced)
    except OSError as error:
        raise DatasetError(f"{out}: cannot be put in place ({error.strerror or error})") from error


def settle(out: Path) -> None:
    """Finish a replacement that a killed command began; usually there is none.

    The caller holds the lock of `out`.

    Raises:
        DatasetError: if something foreign is in the way.
    """
    restore(out)
    if not (out / REPORTS).exists():
        return
    replaced = name_replaced(out)
    if _is_replaced(replaced, by=out) or (replaced.is_dir() and not list_paths(replaced)):
        remove_own(replaced, last=[MANIFEST])
    remove_own(out, below=REPORTS, last=[REPLACES, RECIPE])


def is_settled(out: Path) -> bool:
    """Say whether no replacement of this dataset was interrupted."""
    in_place = (out / REPORTS).exists()
    return not in_place and not _is_replaced(name_replaced(out), by=name_growing(out))


def find_replaced(out: Path) -> Path | None:
    """Return the replaced dataset that a killed command did not remove; None without one."""
    places = (name_replaced(out), name_growing(out))
    return next((place for place in places if _is_replaced(place, by=out)), None)


def _rename_or_put_back(growing: Path, out: Path, replaced: Path) -> None:
    try:
        growing.rename(out)
    except OSError:
        replaced.rename(out)
        raise


def _is_replaced(old: Path, *, by: Path) -> bool:
    """Say whether a folder holds the dataset that another one takes the place of.

    Raises:
        DatasetError: if that cannot be read, so that nobody knows which of the two may go.
    """
    try:
        if not ((by / REPLACES).is_file() and (old / MANIFEST).is_file()):
            return False
        told = read_bytes(by / REPLACES, MANIFEST_FILE, error=DatasetError)
        return hash_manifest(old).encode() == told
    except TooLargeError:  # no manifest of ours is
        return False
    except OSError as error:
        raise DatasetError(f"{old}: cannot be read ({error.strerror or error})") from error
