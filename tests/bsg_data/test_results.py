"""The seal of a folder: what belongs together is put in place together, and a change is found."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

import pytest
from killed_process import start, wait_for
from refusals import refuses

from bsg_data import results
from bsg_data.errors import DatasetError
from bsg_data.results import (
    SEAL,
    UNFINISHED,
    read_seal,
    refuse_file,
    require_seal,
    write_files,
    write_results,
)


def write(folder: Path, **files: str) -> None:
    with write_results(folder, report="a") as staged:
        for name, text in files.items():
            (staged / name).write_text(text)


def test_files_are_sealed_as_sha256sum_has_it(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1", b="2")
    assert list(require_seal(out) or ()) == ["a", "b"]
    done = subprocess.run(["sha256sum", "--check", "--strict", SEAL], cwd=out, capture_output=True)
    assert done.returncode == 0
    assert sorted(path.name for path in out.iterdir()) == [SEAL, "a", "b"]


def test_a_name_may_hold_what_separates_lines_elsewhere(tmp_path: Path) -> None:
    out, files = tmp_path / "out", {"a": "1", "b\u2028c": "2", "d\x85e": "3"}
    for _ in range(2):  # the second finds the first to be its own
        write(out, **files)
        assert [*(require_seal(out) or ())] == [*files]


def test_what_is_no_longer_written_goes_and_what_is_not_ours_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1", b="2", c="3")
    (out / "mine").write_text("mine")
    write(out, a="4")
    assert sorted(path.name for path in out.iterdir()) == [SEAL, "a", "mine"]
    assert require_seal(out) == read_seal(out)
    assert (out / "a").read_text() == "4"


def test_results_of_another_kind_are_never_replaced(tmp_path: Path) -> None:
    """An evaluation in the folder of a run would remove all that the seal of the run lists."""
    out = tmp_path / "out"
    write(out, a="1", b="2")
    with refuses(DatasetError, "other-results", out), write_results(out, report="z"):
        pass
    assert require_seal(out) == read_seal(out)


@pytest.mark.parametrize("name", ["a", "b", SEAL])
def test_a_file_of_somebody_else_is_never_replaced(name: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_text("mine")
    with pytest.raises(DatasetError):
        write(out, a="1", b="2")
    assert [path.read_text() for path in out.iterdir()] == ["mine"]


def test_a_new_name_is_not_that_of_a_file_of_somebody_else(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1")
    (out / "b").write_text("mine")
    with refuses(DatasetError, "path-taken", out / "b"):
        write(out, a="2", b="3")
    assert (out / "b").read_text() == "mine"
    assert (out / "a").read_text() == "1"
    assert require_seal(out)


@pytest.mark.heavy
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_killed_at_any_change_of_a_file(tmp_path: Path, stride: int) -> None:
    """What is not whole has no seal, and the same command again gets through."""
    at, ends = 1, []
    while True:
        out = tmp_path / str(at) / "out"
        write(out, a="1", b="2", c="3")
        old = read_seal(out)
        work = partial(write, out, a="4", b="2", d="5")
        how = wait_for(*start(work, inside=out, kill_at=at)).how
        sealed = require_seal(out)
        ends.append("old" if sealed == old else "none" if sealed is None else "new")
        if how == "done":
            break
        assert how == "killed"
        write(out, a="4", b="2", d="5")
        assert list(require_seal(out) or ()) == ["a", "b", "d"]
        assert not (out / UNFINISHED).exists()
        at += stride
    assert ends == sorted(ends, key=["old", "none", "new"].index)
    assert set(ends) == {"old", "none", "new"}


def test_a_second_command_leaves_the_first_alone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with write_results(out, report="a") as staged:
        (staged / "a").write_text("1")
        with refuses(DatasetError, "folder-busy"), write_results(out, report="a"):
            pass
        assert (staged / "a").read_text() == "1"
    assert require_seal(out)


def test_old_results_are_replaced_by_force_alone(tmp_path: Path) -> None:
    write(tmp_path / "out", a="1")
    with (
        refuses(DatasetError, "path-taken", tmp_path / "out" / "a"),
        write_results(tmp_path / "out", report="a", force=False),
    ):
        pass
    with refuses(DatasetError, "sealed-file", tmp_path / "out" / "a"):
        refuse_file(tmp_path / "out" / "a", force=True)
    (tmp_path / "page.html").touch()
    refuse_file(tmp_path / "page.html", force=True)
    with refuses(DatasetError, "path-taken", tmp_path / "page.html"):
        refuse_file(tmp_path / "page.html", force=False)
    robot = '{"format": "bsg-partial-graph", "scene_id": "home", "rooms": []}'  # said by hand
    quoted = 'x = {"format": "bsg-belief-graph"}  # my script'
    page = "<title>bsg-belief</title>"
    for name, work in (("a.html", page), ("a.json", robot), ("a.py", quoted)):
        (tmp_path / name).write_text(work)
        with refuses(DatasetError, "foreign-file", tmp_path / name):
            refuse_file(tmp_path / name, force=True)


@pytest.mark.parametrize("line", ["0" * 64 + "  ../a", "0" * 63 + "  a", "", "0" * 64 + " a"])
def test_a_line_that_is_none_is_named(tmp_path: Path, line: str) -> None:
    (tmp_path / SEAL).write_text("1" * 64 + f"  a\n{line}\n")
    with refuses(DatasetError, "seal-line", f"{tmp_path / SEAL}, line 2"):
        read_seal(tmp_path)


def test_a_changed_and_a_missing_file_are_named(tmp_path: Path) -> None:
    write(tmp_path / "out", a="1", b="2")
    (tmp_path / "out" / "b").write_text("3")
    with refuses(DatasetError, "file-changed", tmp_path / "out" / "b"):
        require_seal(tmp_path / "out")
    (tmp_path / "out" / "a").unlink()
    with refuses(DatasetError, "file-missing", tmp_path / "out" / "a"):
        require_seal(tmp_path / "out")


def test_no_results_are_written_into_a_dataset(dataset: Path) -> None:
    with refuses(DatasetError, "inside-dataset", dataset / "out"):
        write(dataset / "out", a="1")


def test_a_stage_that_was_left_gives_no_leave_to_replace_what_is_somebody_elses(
    tmp_path: Path,
) -> None:
    """Only what a killed command committed, and nobody changed since, is replaced without force."""
    mine, other = tmp_path / "a", tmp_path / "b"
    (tmp_path / ".a.unfinished").mkdir()
    mine.write_text("mine")
    for paths in ([mine], [other, mine]):
        with refuses(DatasetError, "path-taken", mine), write_files(paths, force=False):
            pass
    out = tmp_path / "out"
    (out / UNFINISHED).mkdir(parents=True)
    (out / "b").write_text("mine")
    with refuses(DatasetError, "path-taken", out / "b"):
        write(out, a="1", b="2")
    assert [path.read_text() for path in (mine, out / "b")] == ["mine", "mine"]


def test_an_error_while_files_are_committed_leaves_a_way_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    write(out, a="1", b="2")
    (out / "b").unlink()
    (out / "b").mkdir()  # no file can be renamed over a folder
    with refuses(DatasetError, "not-written", out, golden=False):
        write(out, a="3", b="4")
    (out / "b").rmdir()
    write(out, a="3", b="4")
    assert list(require_seal(out) or ()) == ["a", "b"]


def test_single_files_are_one_result(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_text(old := '{"format": "bsg-network"}')
    second.mkdir()
    with refuses(DatasetError, "path-folder", second), write_files([first, second], force=True):
        pass
    assert first.read_text() == old
    second.rmdir()

    def fail() -> None:
        with write_files([first, second], force=True) as staged:
            staged[first].write_text("new")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert first.read_text() == old
    with write_files([first, second], force=True) as staged:
        staged[first].write_text("new")
        staged[second].write_text("new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    assert first.read_text() == second.read_text() == "new"


class Killed(BaseException):
    """Stands for the end of the process."""


def test_what_is_written_within_the_block_of_another_is_one_result_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page, folders = tmp_path / "page", (tmp_path / "one", tmp_path / "two")
    move = results._move_staged

    def work(fault: Exception | None = None) -> None:
        with write_files([page], force=False) as files:
            files[page].write_text("new")
            for folder in folders:
                with write_results(folder, report="a", force=False) as staged:
                    (staged / "a").write_text("new")
                assert (staged / "a").exists(), "it is committed with the rest"
            if fault:
                raise fault

    def be_killed(folder: Path, leaving: Collection[str]) -> None:
        if folder == folders[1]:
            raise Killed
        move(folder, leaving)

    with pytest.raises(RuntimeError):
        work(RuntimeError())
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(results, "_move_staged", be_killed)
    with pytest.raises(Killed):
        work()
    monkeypatch.undo()
    assert [(folder / "a").exists() for folder in folders] == [True, False]
    with pytest.raises(RuntimeError):  # after which it is still known what the killed one left
        work(RuntimeError())
    work()
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["one", "page", "two"]
    for folder in folders:
        assert sorted(path.name for path in folder.iterdir()) == [SEAL, "a"]


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.heavy
@pytest.mark.parametrize("old", [False, True])
def test_killed_twice_at_any_change_of_a_file(old: bool, tmp_path: Path, stride: int) -> None:
    """The command of the second kill is that which repeats the first."""
    work: Callable[[Path], None] = write_three if old else partial(write_three, force=False)
    hows = set()
    for first in range(1, 40, stride):
        for second in range(1, 40, 2 * stride):
            out = tmp_path / "out"
            shutil.rmtree(out, ignore_errors=True)
            if old:
                write(out, a="old", b="old", d="old")
            ends = [
                wait_for(*start(partial(work, out), inside=out, kill_at=at))
                for at in (first, second)
            ]
            assert all(one.how != "failed" for one in ends), ends
            hows.add(ends[0].how)
            if old or require_seal(out) is None:  # else all was committed
                work(out)
                assert sorted(path.name for path in out.iterdir()) == [SEAL, "a", "b", "c"]
            assert list(require_seal(out) or ()) == ["a", "b", "c"]
    assert "killed" in hows


def write_three(out: Path, *, force: bool = True) -> None:
    with write_results(out, report="a", force=force) as staged:
        for name in "abc":
            (staged / name).write_text("new")
