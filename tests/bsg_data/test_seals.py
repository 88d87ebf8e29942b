"""The seal of a folder: what belongs together is put in place together, and a change is found."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_data.lock import hold
from bsg_data.result_folder import Place, recover
from bsg_data.seals import (
    SEAL,
    read_seal,
    refuse_sealed_file,
    replace_sealed,
    require_seal,
    write_seal,
)


def write(folder: Path, **files: str) -> None:
    with replace_sealed(folder, report="a") as (staged,):
        for name, text in files.items():
            (staged / name).write_text(text)


def test_files_are_sealed_as_sha256sum_has_it(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1", b="2")
    assert list(require_seal(out) or ()) == ["a", "b"]
    done = subprocess.run(["sha256sum", "--check", "--strict", SEAL], cwd=out, capture_output=True)
    assert done.returncode == 0
    assert sorted(path.name for path in out.iterdir()) == [SEAL, "a", "b"]


def test_what_is_no_longer_written_goes_and_what_is_not_ours_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1", b="2", c="3")
    (out / "mine").write_text("mine")
    (out / "c").write_text("changed by me")
    write(out, a="4")
    assert sorted(path.name for path in out.iterdir()) == [SEAL, "a", "c", "mine"]
    assert require_seal(out) == read_seal(out)
    assert (out / "a").read_text() == "4"


def test_results_of_another_kind_are_never_replaced(tmp_path: Path) -> None:
    """An evaluation in the folder of a run would remove all that the seal of the run lists."""
    out = tmp_path / "out"
    write(out, a="1", b="2")
    with (
        pytest.raises(DatasetError, match=r"holds other results \(a\)"),
        replace_sealed(out, report="z"),
    ):
        pass
    assert require_seal(out) == read_seal(out)


@pytest.mark.parametrize("name", ["a", "b", SEAL])
def test_a_file_of_somebody_else_is_never_replaced(name: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_text("mine")
    if name == "a":  # results from before there were seals have it
        write(out, a="1", b="2")
        assert require_seal(out)
        return
    with pytest.raises(DatasetError, match=f"{name}: belongs to no results of this command"):
        write(out, a="1", b="2")
    assert [path.read_text() for path in out.iterdir()] == ["mine"]


def test_a_new_name_is_not_that_of_a_file_of_somebody_else(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1")
    (out / "b").write_text("mine")
    with pytest.raises(DatasetError, match="b: belongs to no results"):
        write(out, a="2", b="3")
    assert (out / "b").read_text() == "mine"
    assert (out / "a").read_text() == "1"
    assert require_seal(out)


def test_what_fails_leaves_the_old(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1")

    def fail() -> None:
        with replace_sealed(out, report="a") as (staged,):
            (staged / "a").write_text("2")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert require_seal(out)
    assert (out / "a").read_text() == "1"


NO_LINKS = """
import os

def refuse(*words, **options):
    raise OSError(1, "Operation not permitted")

os.link = refuse
"""
REPLACE = """
import os, sys
from pathlib import Path
from bsg_data.seals import replace_sealed

left = int(sys.argv[2])

def count(event, args):
    global left
    if event in ("os.rename", "os.remove", "os.link", "os.mkdir", "os.rmdir"):
        left -= 1
        if left == 0:
            os._exit(9)

sys.addaudithook(count)
with replace_sealed(Path(sys.argv[1]), report="a") as (staged,):
    (staged / "a").write_text("2")
"""


@pytest.mark.slow
@pytest.mark.parametrize("before", ["", NO_LINKS], ids=["links", "no links"])
def test_what_is_no_longer_written_goes_also_if_the_command_was_killed(
    before: str, tmp_path: Path, stride: int
) -> None:
    """Killed before every change of a folder, then run again: the same files as without."""
    code = before + REPLACE
    for at in range(1, 100, stride):
        out = tmp_path / str(at)
        write(out, a="1", b="1")
        killed = run(code, out, at)
        seen = read_seal(out)
        assert seen is None or require_seal(out), "what is visible belongs together"
        if killed:
            recover([Place(out, last=SEAL)])
            assert require_seal(out), "what was there is there again, or what is new"
        assert run(code, out, 0) == 0
        assert {path.name for path in out.iterdir()} == {"a", SEAL}
        assert (out / "a").read_text() == "2"
        if killed == 0:
            break
    assert 10 < at < 99


def run(code: str, out: Path, at: int) -> int:
    words = [sys.executable, "-c", code, str(out), str(at)]
    return subprocess.run(words, check=False).returncode


@pytest.mark.parametrize("name", ["a", SEAL, "b"])
def test_a_file_beside_results_is_none_of_them(tmp_path: Path, name: str) -> None:
    write(tmp_path, a="1")
    before = (tmp_path / SEAL).read_bytes()
    beside = [Place(tmp_path / name, is_file=True)]

    def write_more() -> None:
        with replace_sealed(tmp_path, report="a", beside=beside) as (staged, other):
            (staged / "a").write_text("2")
            (staged / "b").write_text("2")
            other.write_text("3")

    with pytest.raises(DatasetError, match="is one of the results"):
        write_more()
    assert (tmp_path / SEAL).read_bytes() == before
    assert require_seal(tmp_path)


@pytest.mark.parametrize("name", ["results/sub/b", "results/link/b", "link/b", "results/sub/a"])
def test_a_file_in_a_folder_of_results_is_one_of_them(tmp_path: Path, name: str) -> None:
    """The seal of a folder above lists it, by whatever way it is named."""
    (tmp_path / "results" / "sub").mkdir(parents=True)
    (tmp_path / "results" / "sub" / "b").write_text("1")
    write_seal(tmp_path / "results", ["sub/b"])
    for link in (tmp_path / "link", tmp_path / "results" / "link"):
        link.symlink_to(tmp_path / "results" / "sub")
    if name.endswith("/a"):
        refuse_sealed_file(tmp_path / name)
        return
    with pytest.raises(
        DatasetError, match=r"is one of the results that SHA256SUMS lists in .*/res"
    ):
        refuse_sealed_file(tmp_path / name)


def test_one_at_a_time(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with hold(out), pytest.raises(DatasetError, match="another command is writing there"):
        write(out, a="1")


def test_a_folder_without_a_seal_says_nothing(tmp_path: Path) -> None:
    assert require_seal(tmp_path) is None


@pytest.mark.parametrize(
    "line",
    ["", "x", "0" * 64, f"{'0' * 64} a", f"{'0' * 64}  /a", f"{'0' * 64}  b/../../a",
     f"{'0' * 64}  a\0", f"{'0' * 63}x  a", f"{'A' * 64}  a", f"{'0' * 64}  a\n{'0' * 64}  a"],
)  # fmt: skip
def test_a_line_that_is_none_is_refused(tmp_path: Path, line: str) -> None:
    (tmp_path / SEAL).write_text(line + "\n")
    with pytest.raises(DatasetError, match=r"line [12]: expected a sha256"):
        read_seal(tmp_path)


def test_a_file_that_is_gone_or_changed_is_named(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    write_seal(tmp_path, ["a"])
    (tmp_path / "a").write_text("2")
    with pytest.raises(DatasetError, match="a: was changed"):
        require_seal(tmp_path)
    (tmp_path / "a").unlink()
    with pytest.raises(DatasetError, match="cannot be read"):
        require_seal(tmp_path)
    with pytest.raises(DatasetError, match="cannot be sealed"):
        write_seal(tmp_path, ["a"])
    (tmp_path / SEAL).write_bytes(b"\xff\n")
    with pytest.raises(DatasetError, match="is damaged: not text"):
        read_seal(tmp_path)
    (tmp_path / SEAL).write_text("no end of a line")
    with pytest.raises(DatasetError, match="is damaged"):
        read_seal(tmp_path)


def test_a_seal_speaks_of_nothing_behind_a_link(tmp_path: Path) -> None:
    out, victim = tmp_path / "out", tmp_path / "victim"
    victim.mkdir()
    (victim / "thesis.txt").write_text("years")
    out.mkdir()
    (out / "sub").symlink_to(victim)
    (out / "a").write_text("0")
    write_seal(out, ["a", "sub/thesis.txt"])
    with pytest.raises(DatasetError, match="is a link"):
        require_seal(out)
    write(out, a="1")
    assert (victim / "thesis.txt").read_text() == "years"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with a name")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a")
    (tmp_path / SEAL).write_text(f"{'0' * 64}  a\n")
    with pytest.raises(DatasetError, match="is no file on a disk"):
        require_seal(tmp_path)
    (tmp_path / SEAL).unlink()
    os.mkfifo(tmp_path / SEAL)
    with pytest.raises(DatasetError, match="is damaged"):
        require_seal(tmp_path)


def test_a_sealed_file_that_grew_without_end_is_not_read(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, a="1")
    os.truncate(out / "a", 300 * 2**30)
    with pytest.raises(DatasetError, match="322,122,547,200 bytes; expected at most"):
        require_seal(out)
