"""Put single files in place: all are written beside, flushed, and then renamed one by one.

write_files    files that a user named              in .NAME.partial/NAME
write_into     files of a folder that has others    in FOLDER/.bsg-partial
"""

from __future__ import annotations

import filecmp
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

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
from bsg_data.places import is_left, refuse_datasets, refuse_file, taken
from bsg_data.results import name_staged
from bsg_data.seal import SEAL


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
            refuse_links(stages[next(one for one in new.parents if one in stages)], path.parent)
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
