"""Folders and files are put in place whole, and nothing of somebody else is replaced.

That a kill leaves the old or the new is shown in tests/faults/test_kills.py.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.errors import DatasetError
from bsg_data.places import refuse_file
from bsg_data.results import write_files, write_results
from bsg_data.seal import SEAL, read_seal, require_seal


def write(folder: Path, *, force: bool = True, **files: str) -> None:
    with write_results(folder, report="a", force=force) as staged:
        for name, text in files.items():
            (staged / name).write_text(text)


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_files_are_sealed_as_sha256sum_has_it(tmp_path: Path) -> None:
    out, files = tmp_path / "out", {"a": "1", "b\u2028c": "2", "d\x85e": "3"}
    for _ in range(2):
        write(out, **files)
        assert [*(require_seal(out) or ())] == [*files]
    done = subprocess.run(["sha256sum", "--check", "--strict", SEAL], cwd=out, capture_output=True)
    assert done.returncode == 0
    assert names_in(tmp_path) == ["out"]


def test_results_are_replaced_as_a_whole_and_by_force_alone(tmp_path: Path) -> None:
    """Those in them that have a seal of their own, such as those of a run, stay."""
    out = tmp_path / "out"
    (tmp_path / ".out.replaced").mkdir()  # a command was killed before it removed this
    write(out, a="1", b="2")
    write(out / "inner", a="3")
    with refuses(DatasetError, "path-taken", out):
        write(out, force=False, a="4")
    write(out, a="4")
    assert names_in(out) == [SEAL, "a", "inner"]
    assert (out / "a").read_text() == "4"
    assert require_seal(out / "inner")
    assert names_in(tmp_path) == ["out"]


def test_what_is_not_of_these_results_stops_them(tmp_path: Path) -> None:
    out, mine = tmp_path / "out", tmp_path / "mine"
    write(out, a="1", b="2")
    with refuses(DatasetError, "other-results", out), write_results(out, report="z"):
        pass
    (out / "notes.txt").write_text("mine")
    with refuses(DatasetError, "foreign-file", out):
        write(out, a="3")
    mine.mkdir()
    (mine / "b").write_text("mine")
    with refuses(DatasetError, "path-taken", mine):
        write(mine, a="1")
    assert require_seal(out) == read_seal(out)
    assert names_in(mine) == ["b"]
    assert names_in(tmp_path) == ["mine", "out"]


@pytest.mark.parametrize("name", ["out.partial", ".out.replaced"])
def test_a_folder_of_somebody_else_that_is_called_as_ours_stays(name: str, tmp_path: Path) -> None:
    (tmp_path / name).mkdir()
    (tmp_path / name / "thesis.tex").write_text("years of work")
    write(tmp_path / "run", a="1")
    (tmp_path / "run").rename(tmp_path / "out")
    with pytest.raises(DatasetError):
        write(tmp_path / "out", a="2")
    assert (tmp_path / name / "thesis.tex").read_text() == "years of work"


def test_a_changed_seal_or_file_and_a_missing_file_are_named(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1", b="2")
    (out / "b").write_text("3")
    with refuses(DatasetError, "file-changed", out / "b"):
        require_seal(out)
    (out / "a").unlink()
    with refuses(DatasetError, "file-missing", out / "a"):
        require_seal(out)
    for line in ("0" * 64 + "  ../a", "0" * 63 + "  a", "", "0" * 64 + " a"):
        (out / SEAL).write_text("1" * 64 + f"  a\n{line}\n")
        with refuses(DatasetError, "seal-line", f"{out / SEAL}, line 2"):
            read_seal(out)


def test_a_file_is_replaced_by_force_alone_and_nothing_that_is_sealed(
    dataset: Path, tmp_path: Path
) -> None:
    write(tmp_path / "out", a="1")
    with refuses(DatasetError, "sealed-file", tmp_path / "out" / "a"):
        refuse_file(tmp_path / "out" / "a", force=True)
    with refuses(DatasetError, "inside-dataset", dataset / "out"):
        write(dataset / "out", a="1")
    (tmp_path / "page.html").write_text("mine")
    refuse_file(tmp_path / "page.html", force=True)
    with refuses(DatasetError, "path-taken", tmp_path / "page.html"):
        refuse_file(tmp_path / "page.html", force=False)


def test_files_of_one_command_are_put_in_place_together(tmp_path: Path) -> None:
    first, second = tmp_path / "a", tmp_path / "b"
    first.write_text("old")
    second.mkdir()
    with refuses(DatasetError, "path-folder", second), write_files([first, second], force=True):
        pass
    second.rmdir()

    def work(fault: Exception | None = None, *, force: bool = True) -> None:
        with write_files([first, second], force=force) as staged:
            for path in staged.values():
                path.write_text("new")
            if fault:
                raise fault

    with pytest.raises(RuntimeError):
        work(RuntimeError())
    assert first.read_text() == "old"
    work()
    assert names_in(tmp_path) == ["a", "b"]
    assert first.read_text() == second.read_text() == "new"
