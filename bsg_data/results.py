"""Write folders and files: stage them, flush them, commit them; a kill leaves old or new.

    write_folder    a folder of ours alone    staged in FOLDER.partial, committed by one rename
    write_results   files of any folder       in FOLDER/.bsg-unfinished, a rename each, seal last
    write_files     files of one command      in .NAME.unfinished/NAME, a rename each

What is written within the block of another is one result with it: nothing is committed before all
is written. What is staged stays until all is committed, with a list of the files beside it that are
ours. So a command that was killed runs again, however often: it may replace those files, while they
are as the list says, and no others.

The seal is `SHA256SUMS`; a folder of results without it is unfinished. `bsg-models verify` and
`sha256sum -c SHA256SUMS` check it.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import (
    flush_file,
    flush_folder,
    hold,
    list_files,
    name_finished,
    refuse_device,
    refuse_links,
    resolve_links,
    write_bytes,
)
from bsg_data.inputs.bounded_file import hash_file

SEAL = "SHA256SUMS"
UNFINISHED = ".bsg-unfinished"
_OURS = ".ours"  # in a stage: the files beside it that are ours, though no seal says so
BUILD = ".build"  # of a folder that is not committed yet, or replaced another just now
PLAN = f"{BUILD}/plan.json"
_DATASET = "dataset.json"  # the file by which a dataset is known
_STAGE = ".unfinished"  # ends the name of the folder in which a single file is staged
_OF_BUILD = re.compile(rf"{re.escape(BUILD)}/(?:plan|part-[0-9]{{5}})\.json[^/]*")
_ASIDE = ".{}.replaced"  # name of a folder while another replaces it
_LINE = re.compile(r"(?P<sha256>[0-9a-f]{64})  (?P<name>(?!/)[^\\\x00-\x1f]+)")
# What our single files say of themselves: a belief graph and the words of a network at their
# start, Hydra's graph with a belief, a network and a figure anywhere, a page in its head, a table
# of predictions in its schema, a recording of Rerun in its header.
_MARK = re.compile(
    rb"""\A\{\s*"format":\ ?"bsg-(?:belief-graph|network)"
    |"belief":\{"added":"
    |format\W{1,5}bsg-network
    |<meta\ name="generator"\ content="bsg-page">
    |(?:Creator\W{1,5}|<dc:title>)bsg-figure
    |bsg\.masks_sha256
    |\ARRF2.{1,200}belief-scene-graphs""",
    re.DOTALL | re.VERBOSE,
)
_ENDS = 2**18  # bytes at both ends of a file, where it says so
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


@dataclass(frozen=True, slots=True)
class FolderKind:
    """A kind of folder with files of ours alone."""

    what: str  # in words: `dataset`
    mark: str  # the file that is written last, and makes it a finished one
    owns: Callable[[Path], Callable[[str], bool]]  # of a folder: whether a path below it is ours


def name_staged(folder: Path) -> Path:
    """Return the folder in which one is staged that `write_folder` commits."""
    return folder.with_name(f"{folder.name}.partial")


@contextmanager
def write_folder(
    folder: Path, kind: FolderKind, *, plan: bytes, force: bool
) -> Iterator[tuple[Path, bool]]:
    """Lock the path of a folder, yield one to write into, and commit that at the end.

    What raises leaves the staged folder; a command with the same plan goes on with it.

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
        staged = name_staged(folder)
        _prepare(staged, kind, plan)
        yield staged, False
        try:
            flush_folder(staged)
            if (folder / kind.mark).is_file():
                _exchange(staged, folder)
            else:
                staged.rename(folder)
            flush_folder(folder.parent)
        except OSError as error:
            raise DatasetError(
                f"{folder}: cannot be put in place ({error.strerror or error}); the finished "
                f"{kind.what} is {staged}: run the command again",
                code="not-written",
                where=folder,
            ) from error
        recover(folder, kind)


def require_free(folder: Path, kind: FolderKind, *, force: bool) -> None:
    """Refuse a path where no folder of a kind can be put."""
    with suppress(FileNotFoundError):  # the working folder was removed
        if folder in (Path.cwd(), *Path.cwd().parents):
            raise DatasetError(
                f"{folder}: is the working folder or contains it; run this from another folder",
                code="working-folder",
                where=folder,
            )
    for outer in folder.parents:
        _refuse_inside(folder, outer)
    is_free = not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))
    if is_free or _was_committed(folder, kind):
        return
    if not (folder / kind.mark).is_file():
        message = f"{folder}: exists and is no {kind.what}; choose another --out"
        raise DatasetError(message, code="path-taken", where=folder)
    if not force:
        message = f"{folder}: is a finished {kind.what}; --force replaces it"
        raise DatasetError(message, code="path-taken", where=folder)
    _require_own(folder, kind)


def _was_committed(folder: Path, kind: FolderKind) -> bool:
    """Say whether a command committed a folder, and did not come to its end."""
    return (folder / PLAN).is_file() and (folder / kind.mark).is_file()


def _find_foreign(folder: Path, kind: FolderKind) -> str | None:
    """Return the first file of a folder that no command of this program wrote."""
    is_own = kind.owns(folder)
    paths = (path for path in list_files(folder) if not _OF_BUILD.fullmatch(path))
    return next((path for path in paths if not is_own(path)), None)


def _require_own(folder: Path, kind: FolderKind) -> None:
    """Refuse what is no folder of ours, or holds a file of somebody else."""
    foreign = None
    if folder.is_symlink() or not folder.is_dir():
        what = "is a link or a file"
    elif foreign := _find_foreign(folder, kind):
        what = f"holds {foreign}, which is not ours"
    else:
        return
    message = f"{folder}: {what}; move it away, and run the command again"
    raise DatasetError(message, code="foreign-file", where=folder)


def _prepare(staged: Path, kind: FolderKind, plan: bytes) -> None:
    """Make the folder of what is staged, unless the same plan began it."""
    if staged.exists() or staged.is_symlink():
        _require_own(staged, kind)
        if _read(staged / PLAN) == plan:
            return
        shutil.rmtree(staged)
    (staged / BUILD).mkdir(parents=True)
    partial = staged / f"{PLAN}.partial"  # not flushed: after a loss of power all is made anew
    partial.write_bytes(plan)
    partial.replace(staged / PLAN)


def recover(folder: Path, kind: FolderKind) -> bytes | None:
    """Finish what a killed command began at the path of a folder; the caller holds the lock.

    Returns:
        The plan of the folder, if it was committed by a command that did not come to its end.
    """
    staged, aside = name_staged(folder), folder.with_name(_ASIDE.format(folder.name))
    if aside.is_dir() and not folder.exists():  # killed between two renames
        (staged if (staged / kind.mark).is_file() else aside).rename(folder)
    if not _was_committed(folder, kind):
        return None
    plan = _read(folder / PLAN)
    for old in (staged, aside):  # what was replaced has a mark and no plan, or lost its last file
        is_whole = (old / kind.mark).is_file() and not (old / PLAN).exists()
        if is_whole or (old.is_dir() and not list_files(old)):
            _require_own(old, kind)
            for name in list_files(old):
                if name != kind.mark:  # which goes last, for it says whose the folder is
                    (old / name).unlink()
            shutil.rmtree(old)
    for path in sorted((folder / BUILD).iterdir(), key=lambda path: path.name == "plan.json"):
        if _OF_BUILD.fullmatch(f"{BUILD}/{path.name}"):
            path.unlink()
    with suppress(OSError):
        (folder / BUILD).rmdir()  # unless anything is in it
    return plan


def _exchange(new: Path, old: Path) -> None:
    """Exchange two folders: in one step on Linux, elsewhere by two renames."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if sys.platform == "linux" and rename is not None:
        sys.audit("os.rename", str(new), str(old), -1, -1)  # as os.rename does
        paths = os.fsencode(new), os.fsencode(old)
        if rename(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE) == 0:
            return
    old.rename(old.with_name(_ASIDE.format(old.name)))
    new.rename(old)


def _read(path: Path) -> bytes | None:
    return path.read_bytes() if path.is_file() else None


@contextmanager
def write_results(folder: Path, *, report: str | None, force: bool = True) -> Iterator[Path]:
    """Lock a folder, yield an empty one to write into, and commit its files at the end.

    All other files of the folder stay.

    Args:
        folder: of the results; one with another kind of results is refused.
        report: name of the file that marks this kind of results. They get a seal, files of the old
            seal that are not written again are removed, and files that no seal has are not
            replaced. None: files without a seal.
        force: whether old results are replaced.
    """
    folder = resolve_links(folder)
    staged = folder / UNFINISHED
    refuse_datasets(folder)
    with _joining_command() as command, _writing(folder):
        for is_held in (False, True):  # again: another command may have had the lock
            if is_held:
                folder.parent.mkdir(parents=True, exist_ok=True)
                command.held.enter_context(hold(folder))
            if report is not None:
                refuse_other_results(folder, report)
                _refuse_taken(folder / report, staged, force=force)
        with command.staging(_StagedResults(folder, report, force, is_new=not folder.exists())):
            yield staged


@contextmanager
def write_files(paths: Iterable[Path], *, force: bool) -> Iterator[StagedFiles]:
    """Lock single files, yield where to write each, and commit them together at the end.

    A link is replaced, and not followed. What is not written stays as it is.

    Args:
        paths: of the files; a missing folder is made.
        force: whether files are replaced that are there.
    """
    staged = StagedFiles(tuple(sorted({path.absolute() for path in paths})))
    for path in staged.paths:
        refuse_file(path, force=force)
    with _joining_command() as command, _writing(staged.where):
        for path in staged.paths:
            path.parent.mkdir(parents=True, exist_ok=True)
            command.held.enter_context(hold(path))
        for path in staged.paths:  # again: another command may have had the lock
            refuse_file(path, force=force)
        with command.staging(staged):
            yield staged


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn an error of the disk into one of ours."""
    try:
        yield
    except OSError as error:
        message = f"{path}: cannot be written ({error.strerror or error})"
        raise DatasetError(message, code="not-written", where=path) from error


@contextmanager
def _joining_command() -> Iterator[_Command]:
    """Yield the command whose block this is in, or a new one, and commit that at the end.

    No stage is removed before all is committed: each tells the next command what is ours.
    """
    if (outer := _COMMAND.get()) is not None:
        yield outer
        return
    with ExitStack() as held:
        command = _Command(held)
        within = _COMMAND.set(command)
        try:
            yield command
            for one in command.outputs:
                with _writing(one.where):
                    one.prepare()
        except BaseException:
            for one in command.outputs:
                one.give_up()
            raise
        finally:
            _COMMAND.reset(within)
        for one in command.outputs:
            with _writing(one.where):
                one.commit()
        for one in command.outputs:
            one.close()


@dataclass(slots=True)
class _Command:
    """What a command writes, which is one result."""

    held: ExitStack  # the locks
    outputs: list[_Output] = field(default_factory=list)

    @contextmanager
    def staging(self, output: _Output) -> Iterator[None]:
        """Add an output; what raises within the block leaves its stages as they were found."""
        try:
            output.open()
            yield
        except BaseException:
            output.give_up()
            raise
        self.outputs.append(output)


_COMMAND: ContextVar[_Command | None] = ContextVar("command", default=None)


@dataclass
class _Output(ABC):
    """What is written by one call, in stages until it is committed."""

    def __post_init__(self) -> None:
        self._found: dict[Path, bytes | None] = {}  # stage → what it says of a killed command

    @property
    @abstractmethod
    def where(self) -> Path:
        """The path that an error names."""

    @abstractmethod
    def list_stages(self) -> list[Path]:
        """Return the folders in which it is written."""

    @abstractmethod
    def prepare(self) -> None:
        """Check and flush what was written, and say in the stages what of it will be ours."""

    @abstractmethod
    def commit(self) -> None:
        """Move what was written to its place."""

    def open(self) -> None:
        """Make the stages."""
        for stage in self.list_stages():
            _refuse_link(stage)
            self._found[stage] = _read(stage / _OURS)
            _empty_stage(stage)

    def close(self) -> None:
        """Remove the stages."""
        for stage in self.list_stages():
            shutil.rmtree(stage, ignore_errors=True)

    def give_up(self) -> None:
        """Remove the stages, but for what a killed command left in them."""
        with suppress(OSError):
            for stage, found in self._found.items():
                if found is None:
                    shutil.rmtree(stage, ignore_errors=True)
                else:
                    _empty_stage(stage)
                    write_bytes(stage / _OURS, found)


@dataclass
class StagedFiles(_Output):
    """Single files of one command: where each is written until they are committed together."""

    paths: tuple[Path, ...]

    def __getitem__(self, path: Path) -> Path:
        """Return where to write a file, under its own name; another path stays as it is."""
        own = path.absolute()
        return _stage_of(own) / own.name if own in self.paths else path

    @property
    def where(self) -> Path:
        """The first of them."""
        return next(iter(self.paths), Path())

    def list_stages(self) -> list[Path]:
        """Return the stage of each."""
        return [_stage_of(path) for path in self.paths]

    def prepare(self) -> None:
        """Flush what was written, and say in its stage that it will be ours."""
        for path in self._list_written():
            flush_file(self[path])
            _note_ours(_stage_of(path), [(path.name, hash_file(self[path]))])

    def commit(self) -> None:
        """Move what was written to its path."""
        written = self._list_written()
        for path in written:
            self[path].replace(path)
        for folder in {path.parent for path in written}:
            flush_folder(folder)

    def _list_written(self) -> list[Path]:
        return [path for path in self.paths if self[path].exists()]


@dataclass
class _StagedResults(_Output):
    """Files of a folder, with a seal if they have a report."""

    folder: Path
    report: str | None
    force: bool
    is_new: bool  # whether there was no such folder
    leaving: Collection[str] = ()  # files that are removed

    @property
    def where(self) -> Path:
        return self.folder

    def list_stages(self) -> list[Path]:
        return [self.folder / UNFINISHED]

    def prepare(self) -> None:
        folder, (staged,) = self.folder, self.list_stages()
        names = _list_new(staged)
        sealed = {} if self.report is None else _list_sealed(folder)
        for name in names:
            if self.report is None:
                _refuse_taken(folder / name, staged, force=self.force)
            elif name not in sealed:
                _refuse_foreign(folder / name, staged)
        if self.report is not None:
            if not sealed:
                _refuse_foreign(folder / SEAL, staged)
            write_seal(staged, names)
        self.leaving = {*sealed, *list_committed(folder)} - {*names}
        _note_staged(folder)

    def commit(self) -> None:
        _move_staged(self.folder, self.leaving)

    def close(self) -> None:
        super().close()
        self._leave_nothing()

    def give_up(self) -> None:
        super().give_up()
        self._leave_nothing()

    def _leave_nothing(self) -> None:
        if self.is_new:
            with suppress(OSError):
                self.folder.rmdir()  # unless anything is in it


def _stage_of(path: Path) -> Path:
    """Return the folder in which a single file is staged."""
    return path.with_name(f".{path.name}{_STAGE}")


def _refuse_link(stage: Path) -> None:
    if stage.is_symlink():
        raise DatasetError(f"{stage}: is a link; remove it", code="link", where=stage)


def _empty_stage(stage: Path) -> None:
    """Make a stage, or empty one, but for what it says of files beside it."""
    stage.mkdir(parents=True, exist_ok=True)
    for path in stage.iterdir():
        if path.name != _OURS:
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _note_ours(stage: Path, files: Iterable[tuple[str, str]]) -> None:
    """Add files, name and sha256, to those beside a stage that are ours though no seal says so."""
    lines = "".join(f"{sha256}  {name}\n" for name, sha256 in sorted({*_read_ours(stage), *files}))
    write_bytes(stage / _OURS, lines.encode())


def _read_ours(stage: Path) -> frozenset[tuple[str, str]]:
    """Return the files, name and sha256, that a killed command committed or was to replace."""
    data = b"" if stage.is_symlink() else _read(stage / _OURS) or b""
    lines = map(_LINE.fullmatch, _split_lines(data))
    return frozenset((line["name"], line["sha256"]) for line in lines if line)


def _is_ours(path: Path, stage: Path, name: str) -> bool:
    """Say whether a file is what a killed command left there; a changed one is somebody's."""
    hashes = {sha256 for one, sha256 in _read_ours(stage) if one == name}
    return bool(hashes) and path.is_file() and hash_file(path) in hashes


def list_committed(folder: Path) -> set[str]:
    """Return the files of a folder that killed commands committed, or were to replace."""
    staged = folder / UNFINISHED
    names = {name for name, _ in _read_ours(staged)}
    return {name for name in names if _is_ours(folder / name, staged, name)}


def _note_staged(folder: Path) -> None:
    """Flush all files of `UNFINISHED`, and say there that they and those of the seal are ours."""
    staged = folder / UNFINISHED
    names = _list_new(staged)
    for name in names:
        refuse_links(folder, (folder / name).parent)
        flush_file(staged / name)
    new = [(name, hash_file(staged / name)) for name in names]
    _note_ours(staged, [*_list_sealed(folder).items(), *new])


def _move_staged(folder: Path, leaving: Collection[str]) -> None:
    staged = folder / UNFINISHED
    names = sorted(_list_new(staged), key=lambda name: name == SEAL)
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


def refuse_datasets(path: Path) -> None:
    """Refuse to write into a dataset, because a dataset lists and hashes all its files.

    Call this before anything is written, also before a lock: its file lies beside the folder.
    """
    resolved = resolve_links(path)
    for outer in (resolved, *resolved.parents):
        _refuse_inside(path, outer)


def _refuse_inside(path: Path, outer: Path) -> None:
    if (outer / _DATASET).is_file():
        message = f"{path}: is in the dataset {outer}; choose another place"
        raise DatasetError(message, code="inside-dataset", where=path)


def refuse_file(path: Path, *, force: bool) -> None:
    """Refuse to write a file into a dataset, over sealed results, or, without `force`, at all."""
    refuse_datasets(path)
    resolved = resolve_links(path.parent) / path.name  # a link to the folder leads to the same file
    for folder in resolved.parents:
        if resolved.name == SEAL or resolved.relative_to(folder).as_posix() in _list_sealed(folder):
            raise DatasetError(
                f"{path}: is one of the results that {SEAL} lists in {folder}; name another file",
                code="sealed-file",
                where=path,
            )
    if path.is_dir():
        message = f"{path}: is a folder; name a file"
        raise DatasetError(message, code="path-folder", where=path)
    refuse_device(path)
    stage = _stage_of(path)
    _refuse_taken(path, stage, force=force)
    if os.path.lexists(path) and not (_is_ours(path, stage, path.name) or _is_marked(path)):
        message = (
            f"{path}: nothing in it says that this program wrote it; move it away, or name another"
        )
        raise DatasetError(message, code="foreign-file", where=path)


def _refuse_taken(path: Path, stage: Path, *, force: bool) -> None:
    if os.path.lexists(path) and not force and not _is_ours(path, stage, path.name):
        message = f"{path}: is there already; --force replaces it"
        raise DatasetError(message, code="path-taken", where=path)


def _is_marked(path: Path) -> bool:
    """Say whether a file says itself that this program wrote it; an empty one is nobody's work."""
    if not path.is_file():
        return False
    if path.stat().st_size == 0:
        return True
    with path.open("rb") as file:
        start = file.read(_ENDS)
        file.seek(max(path.stat().st_size - _ENDS, 0))
        return any(map(_MARK.search, (start, file.read(_ENDS))))


def _refuse_foreign(path: Path, stage: Path) -> None:
    if os.path.lexists(path) and not _is_ours(path, stage, path.name):
        raise DatasetError(
            f"{path}: belongs to no results of this command, but would be replaced; move it away, "
            "or choose another folder",
            code="path-taken",
            where=path,
        )


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


def _list_new(staged: Path) -> list[str]:
    return [name for name in list_files(staged) if name_finished(name) != _OURS]


def _list_sealed(folder: Path) -> dict[str, str]:
    """Return the files that the seal of a folder lists; empty for a damaged seal."""
    try:
        return read_seal(folder) or {}
    except DatasetError:
        return {}


def _split_lines(data: bytes) -> list[str]:
    """Return the lines of a seal; a name may hold a U+2028, at which `str.splitlines` splits."""
    return [line.decode("utf-8", "replace") for line in data.splitlines()]


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
    for number, line in enumerate(_split_lines(path.read_bytes()), 1):
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
