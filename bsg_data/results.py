"""Put folders and files in place: they are written beside, flushed, and renamed.

write_folder, write_results   a folder                       in FOLDER.partial
write_files                   files that a user named        in .NAME.partial/NAME
write_into                    files of a folder with others  in FOLDER/.bsg-partial

If a folder replaces another, that is `.FOLDER.replaced` between two renames, and then removed.
`.build/plan.json` in a folder says what it is made of, and goes last: where it lies in a finished
folder, a command was killed after its work was done. Files are renamed one by one.
"""

from __future__ import annotations

import filecmp
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import (
    empty,
    flush_file,
    flush_folder,
    hold,
    list_files,
    refuse_links,
    remove,
    resolve_links,
    writing,
)
from bsg_data.places import (
    BUILD,
    PLAN,
    RESULTS,
    FolderKind,
    is_left,
    refuse_datasets,
    refuse_file,
    refuse_foreign,
    require_free,
    taken,
)
from bsg_data.seal import SEAL, read_seal, refuse_other_results, write_seal


def name_staged(path: Path) -> Path:
    """Return the folder in which one is written that is not in place yet."""
    return path.with_name(f"{path.name}.partial")


@contextmanager
def write_folder(
    folder: Path, kind: FolderKind, *, plan: bytes, force: bool
) -> Iterator[tuple[Path, bool]]:
    """Lock the path of a folder, yield one to write into, and put that in place at the end.

    What raises leaves the folder beside; a command with the same plan goes on with it.

    Args:
        folder: its path, without links.
        kind: of folder.
        plan: all that determines its bytes.
        force: whether a finished one may be replaced.

    Yields:
        The folder to write into; whether the same one is there already.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with hold(folder):
        if recover(folder, kind) == plan:
            yield folder, True
            return
        require_free(folder, kind, force=force)
        _begin(name_staged(folder), plan, goes_on=True)
        yield name_staged(folder), False
        _put(folder, kind)


@contextmanager
def write_results(
    folder: Path, *, report: str, force: bool = True, goes_on: bool = False
) -> Iterator[Path]:
    """Lock the path of a folder, yield one to write into, seal it and put it in place at the end.

    Args:
        folder: of the results. Sealed folders in the old one, as in a run, go into the new one.
        report: name of the file that marks this kind of results.
        force: whether finished ones may be replaced.
        goes_on: whether what a stopped command left in `.build` is kept for the next.
    """
    folder = resolve_links(folder)
    staged = name_staged(folder)
    refuse_datasets(folder)
    with writing(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with hold(folder):
            _settle(folder, RESULTS)
            refuse_other_results(folder, report)
            require_free(folder, RESULTS, force=force)
            _begin(staged, b"results", goes_on=goes_on)
            empty(staged, but=BUILD)
            try:
                yield staged
                names = [name for name in list_files(staged) if not name.startswith(f"{BUILD}/")]
                for name in names:
                    flush_file(staged / name)
                write_seal(staged, names)
            except BaseException:
                if not (goes_on and len(list_files(staged / BUILD)) > 1):
                    _discard(staged)
                raise
            _put(folder, RESULTS)


def recover(folder: Path, kind: FolderKind) -> bytes | None:
    """Finish what a killed command began at the path of a folder; the caller holds the lock.

    Returns:
        The plan of the folder, if its command put it in place and did not come to its end.
    """
    _settle(folder, kind)
    if not is_left(folder):
        return None
    plan = (folder / PLAN).read_bytes()
    empty(folder / BUILD, but=Path(PLAN).name)
    remove(folder / BUILD)
    return plan


def _begin(staged: Path, plan: bytes, *, goes_on: bool) -> None:
    """Make the folder of what is not in place yet, unless the same plan began it."""
    if staged.is_symlink() or staged.is_file():
        raise DatasetError(f"{staged}: is a link or a file; remove it", code="link", where=staged)
    if staged.exists():
        if not is_left(staged):
            refuse_foreign(staged, (path.name for path in staged.iterdir() if path.name != BUILD))
        elif goes_on and (staged / PLAN).read_bytes() == plan:
            return
        _discard(staged)
    (staged / BUILD).mkdir(parents=True)
    partial = staged / f"{PLAN}.partial"  # not flushed: after a loss of power all is made anew
    partial.write_bytes(plan)
    partial.replace(staged / PLAN)


def _discard(staged: Path) -> None:
    """Remove what is not in place yet; its plan, by which it is ours, goes last."""
    empty(staged, but=BUILD)
    remove(staged)


def _put(folder: Path, kind: FolderKind) -> None:
    """Put a finished folder in place, and remove what it replaced and its plan."""
    with writing(folder):
        flush_folder(name_staged(folder))
        if folder.exists():
            folder.rename(_name_aside(folder))
        name_staged(folder).rename(folder)
        flush_folder(folder.parent)
        recover(folder, kind)


def _name_aside(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.replaced")


def _settle(folder: Path, kind: FolderKind) -> None:
    """Finish the replacement of a folder; results in the old one go into the new."""
    aside, staged = _name_aside(folder), name_staged(folder)
    is_ours = aside.is_dir() and ((aside / kind.mark).is_file() or not any(aside.iterdir()))
    if not is_ours:  # the mark goes last
        return
    if not folder.exists() and (staged / kind.mark).is_file():
        staged.rename(folder)
    if folder.exists():
        for inner in aside.iterdir():
            if read_seal(inner) and not (folder / inner.name).exists():
                inner.rename(folder / inner.name)
        empty(aside, but=kind.mark)
        remove(aside)


def was_stopped(paths: Iterable[Path]) -> bool:
    """Say whether a command that writes all these was killed; it may have put some in place."""
    return any(
        name_staged(path).exists() or _name_stage(path).exists() or is_left(path) for path in paths
    )


def _name_stage(path: Path) -> Path:
    return path.absolute().with_name(f".{path.name}.partial")


@contextmanager
def write_files(
    paths: Collection[Path], *, force: bool, left: bool = False
) -> Iterator[Mapping[Path, Path]]:
    """Lock single files, yield where to write each, and rename each to its place at the end.

    A link is replaced, and not followed. What is not written stays as it is.

    Args:
        paths: of the files; a missing folder is made.
        force: whether files are replaced that are there.
        left: whether this command was killed before (`was_stopped`), so that a file which is there
            is refused at the end, and not if it has the same bytes.
    """
    left = left or was_stopped(paths)
    with ExitStack() as held, writing(next(iter(paths), Path())):
        for path in paths:
            refuse_file(path, force=force or left)
        for path in paths:
            path.parent.mkdir(parents=True, exist_ok=True)
            held.enter_context(hold(path.absolute()))
        stages = {_name_stage(path): path.absolute().parent for path in paths}
        with _staging(stages, force=force, left=left):
            yield {path: _name_stage(path) / path.name for path in paths}


@contextmanager
def write_into(folder: Path, *, force: bool) -> Iterator[Path]:
    """Lock a folder, yield an empty one, and rename its files into the first; a seal goes last.

    Args:
        folder: its other files stay.
        force: whether files are replaced that are there.
    """
    folder = resolve_links(folder)
    refuse_datasets(folder)
    stage = folder / ".bsg-partial"
    with writing(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
        with hold(folder), _staging({stage: folder}, force=force, left=stage.exists()):
            yield stage


@contextmanager
def _staging(stages: Mapping[Path, Path], *, force: bool, left: bool = False) -> Iterator[None]:
    """Make folders to write into; at the end, rename the files of each to another folder."""
    is_new = {folder for folder in stages.values() if not folder.exists()}
    try:
        for stage in stages:
            empty(stage)
        yield
        written = {
            stage / name: folder / name
            for stage, folder in stages.items()
            for name in sorted(list_files(stage), key=lambda name: name == SEAL)
        }
        for new, path in written.items():
            is_same = left and path.is_file() and filecmp.cmp(new, path, shallow=False)
            if os.path.lexists(path) and not force and not is_same:
                raise taken(path)
            refuse_links(
                stages[next(outer for outer in new.parents if outer in stages)], path.parent
            )
            flush_file(new)
    except BaseException:
        for path in () if left else (*stages, *is_new):
            remove(path)
        raise
    for new, path in written.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        new.replace(path)
    for folder in {path.parent for path in written.values()}:
        flush_folder(folder)
    for stage in stages:  # last, for by them the next command is told of a kill
        remove(stage)
