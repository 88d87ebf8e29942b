"""Replace result files together: new files are written aside, and put in place when all are whole.

    while files are written   the old results, and `.bsg-unfinished` beside them
    while files are renamed   no seal, so that no mix of old and new is taken for results
    in the end                the new results, and their seal, which is put in place last

A killed command leaves `.bsg-unfinished`: the next one removes it and makes the results again.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import flush_file, flush_folder, refuse_devices, refuse_links, resolve_links
from bsg_data.lock import hold

_DATASET = "dataset.json"  # the file by which a dataset is known
UNFINISHED = ".bsg-unfinished"
_NEW = "new"  # folder in it of the files to be put in place
SCRATCH = "scratch"  # folder in it for what a command writes and reads again


@dataclass(frozen=True, slots=True)
class Place:
    """The final place of results: a folder or a file.

    Attributes:
        path: path of a folder or of a file.
        is_file: whether it is a file.
        last: for a folder: name of the file that marks complete results. It is removed before any
            other file is replaced, and put in place after all others. None if there is none.
    """

    path: Path
    is_file: bool = False
    last: str | None = None

    @property
    def folder(self) -> Path:
        """The folder of the final files."""
        return self.path.parent if self.is_file else self.path

    @property
    def unfinished(self) -> Path:
        """The hidden folder of what is not in its place yet."""
        return self.folder / (f".{self.path.name}{UNFINISHED}" if self.is_file else UNFINISHED)

    @property
    def staged(self) -> Path:
        """The path to write: the new file, or the folder of the new files."""
        return self.unfinished / _NEW / self.path.name if self.is_file else self.unfinished / _NEW


@contextmanager
def replace_together(
    places: Sequence[Place],
    *,
    refuse: Callable[[], None] | None = None,
    leaving: Callable[[], Collection[str]] | None = None,
) -> Iterator[tuple[Path, ...]]:
    """Lock several places, yield paths to write to, and put all files in place at the end.

    Args:
        places: the places.
        refuse: called when the places are locked, to raise an error if anything is in the way.
        leaving: called when all is written; returns the files of the first place that go when the
            new ones come, by their paths in its folder.

    Yields:
        For each place an empty folder to write into, or the path of the file to write. A file that
        is not written is not replaced.

    Raises:
        DatasetError: if another command is writing there, a link or a folder is in the way, a place
            is in a dataset, or a file cannot be written; until all are written, old files stay.
    """
    for place in places:
        refuse_datasets(place.path, is_file=place.is_file)
    try:
        with ExitStack() as held:
            for place in places:
                place.path.parent.mkdir(parents=True, exist_ok=True)
                held.enter_context(hold(place.path))
            if refuse is not None:
                refuse()
            for place in places:
                held.enter_context(_staging(place))
            yield tuple(place.staged for place in places)
            _put_in_place(places, () if leaving is None else leaving())
    except OSError as error:
        message = f"{places[0].path}: cannot be written ({error.strerror or error})"
        raise DatasetError(message, code="not-written", where=places[0].path) from error


@contextmanager
def _staging(place: Place) -> Iterator[None]:
    """Make the hidden folder of a place, and remove it at the end with what it still holds."""
    is_new = not place.is_file and not place.path.exists()
    _clear(place)
    (place.unfinished / _NEW).mkdir(parents=True)
    try:
        yield
    finally:
        with suppress(OSError):
            _clear(place)
        if is_new:
            with suppress(OSError):
                place.path.rmdir()  # unless anything is in it


def _put_in_place(places: Sequence[Place], leaving: Collection[str]) -> None:
    files = [
        (place, path.relative_to(place.unfinished / _NEW).as_posix())
        for place in places
        for path in sorted((place.unfinished / _NEW).rglob("*"))
        if not path.is_dir()
    ]
    for place, path in files:
        refuse_links(place.folder, (place.folder / path).parent)
        refuse_devices(place.folder / path)
        flush_file(place.unfinished / _NEW / path)
    for place in places:
        if place.last is not None:
            (place.folder / place.last).unlink(missing_ok=True)
            flush_folder(place.folder)
    for path in leaving:
        (places[0].folder / path).unlink()
    for place, path in sorted(files, key=lambda file: file[1] == file[0].last):
        (place.folder / path).parent.mkdir(parents=True, exist_ok=True)
        if path == place.last:
            flush_folder(place.folder)
        (place.unfinished / _NEW / path).replace(place.folder / path)
    for folder in {(place.folder / path).parent for place, path in files}:
        flush_folder(folder)


def _clear(place: Place) -> None:
    """Remove what a command left unfinished; a link there leads to nothing of ours."""
    if place.unfinished.is_symlink():
        message = f"{place.unfinished}: is a link; remove it"
        raise DatasetError(message, code="link", where=place.unfinished)
    if place.unfinished.exists():
        shutil.rmtree(place.unfinished)


def refuse_datasets(path: Path, *, is_file: bool = False) -> None:
    """Refuse to write into a dataset, because a dataset lists and hashes all its files.

    Call this before anything is written, also before a lock: its file lies beside the folder.

    Args:
        path: where a command is to write; links on the way are followed.
        is_file: whether it is a file, not a folder.

    Raises:
        DatasetError: naming the dataset.
    """
    folder = resolve_links(path.parent if is_file else path)
    for outer in (folder, *folder.parents):
        if (outer / _DATASET).is_file():
            message = f"{path}: is in the dataset {outer}; choose another place"
            raise DatasetError(message, code="inside-dataset", where=path)


def require_vacant(place: Path) -> None:
    """Refuse to replace results without `--force`.

    Raises:
        DatasetError: naming the place.
    """
    if not is_vacant(place):
        message = f"{place}: is there already; --force replaces it"
        raise DatasetError(message, code="path-taken", where=place)


def is_vacant(folder: Path) -> bool:
    """Say whether a folder is missing, empty, or holds only what a killed command left."""
    if not folder.exists():
        return True
    return folder.is_dir() and {path.name for path in folder.iterdir()} <= {UNFINISHED}
