from __future__ import annotations

import os
from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_data.result_folder import UNFINISHED, Place, is_vacant, replace_files, replace_together

FILES = {"report.json": "json", "table.csv": "table", "pictures/one.png": "picture"}


def write(folder: Path, version: str, *, last: str | None = "report.json") -> None:
    with replace_files(folder, last=last) as staged:
        for path, content in FILES.items():
            (staged / path).parent.mkdir(exist_ok=True)
            (staged / path).write_text(f"{content} {version}")


def read(folder: Path) -> dict[str, str]:
    found = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_text() for path in found}


def expected(version: str) -> dict[str, str]:
    return {path: f"{content} {version}" for path, content in FILES.items()}


def test_files_change_together_and_others_stay(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    write(out, "old")
    assert read(out) == expected("old")
    (out / "notes.txt").write_text("mine")
    write(out, "new")
    assert read(out) == expected("new") | {"notes.txt": "mine"}
    assert sorted(path.name for path in (tmp_path / "deep").iterdir()) == ["out"]


def test_what_raises_changes_nothing_and_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"

    def fail() -> None:
        with replace_files(out, last=None) as staged:
            (staged / "report.json").write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert not out.exists()
    write(out, "old")
    with pytest.raises(KeyError):
        fail()
    assert read(out) == expected("old")
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize("failing", range(4))
def test_a_rename_that_fails_is_undone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    out = tmp_path / "out"
    write(out, "old")
    (out / "table.csv").unlink()  # one of them is new
    before, calls = read(out), [0]
    rename = Path.replace

    def replace(path: Path, target: Path) -> Path:
        calls[0] += 1
        if calls[0] == failing + 1:
            raise OSError(5, "Input/output error")
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", replace)
    if failing == len(FILES):
        write(out, "new")
        assert read(out) == expected("new")
    else:
        with pytest.raises(DatasetError, match=r"out: cannot be written \(Input/output error\)"):
            write(out, "new")
        assert read(out) == before


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # threads of Arrow stay behind
def test_killed_anywhere_no_mix_has_the_last_file(tmp_path: Path) -> None:
    """Die before the n-th call that changes names, for each n; the same command gets through."""
    died = 0
    for number in range(100):
        out = tmp_path / str(number)
        write(out, "old")
        child = os.fork()
        if not child:
            _die_at(number)
            write(out, "new")
            os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0:
            break
        died += 1
        found = {name: text for name, text in read(out).items() if UNFINISHED not in name}
        if "report.json" in found:
            assert found in (expected("old"), expected("new"))
        write(out, "new")
        assert read(out) == expected("new")
    assert died >= 8


def replace_all(root: Path, version: str, *, found: dict[str, str] | None = None) -> None:
    """Write a folder of results, a folder beside it and a page; note what was there before."""

    def look() -> None:
        if found is not None:
            now = read(root)
            found.update({name: now[name] for name in now if not name.endswith(".lock")})

    places = [
        Place(root / "out", last="report.json"),
        Place(root / "other"),
        Place(root / "page.html", is_file=True),
    ]
    with replace_together(places, refuse=look) as (out, other, page):
        for folder in (out, other):
            (folder / "report.json").write_text(version)
            (folder / "pictures").mkdir()
            (folder / "pictures" / "one.png").write_text(version)
        page.write_text(version)


@pytest.mark.parametrize("has_old", [False, True])
def test_what_is_killed_anywhere_is_undone_by_the_next_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stride: int, *, has_old: bool
) -> None:
    """Die at the n-th change, and so does who comes next: there is all of before, or all of after.

    Where nothing was there before, nothing of the killed command is in the way of the same one.
    """
    monkeypatch.setattr(os, "fsync", lambda _: None)  # which takes most of the time
    died = 0
    for number in range(0, 200, stride):
        root = tmp_path / str(number)
        root.mkdir()
        if has_old:
            replace_all(root, "old")
        before = read(root)
        if _run_and_die(root, number):
            break
        died += 1
        _run_and_die(root, number % 7)  # while it undoes what the first had begun
        found: dict[str, str] = {}
        replace_all(root, "newer", found=found)
        after = dict.fromkeys(read(root), "new")
        assert found in (before, after)
        assert read(root) == dict.fromkeys(after, "newer")
        assert sorted(path.name for path in root.iterdir()) == ["other", "out", "page.html"]
    assert died >= 20 // stride


def _run_and_die(root: Path, number: int) -> bool:
    """Write all in another process that dies at a change; say whether it got through."""
    child = os.fork()
    if not child:
        _die_at(number)
        replace_all(root, "new")
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_undoing_takes_away_nothing_that_another_put_there(tmp_path: Path) -> None:
    """A folder from elsewhere may say that something was begun; whose the files are is seen."""
    begun = tmp_path / "out" / UNFINISHED / "own"
    begun.mkdir(parents=True)
    (begun / "report.json").write_text("mine")
    (tmp_path / "out" / "report.json").write_text("mine")
    found: dict[str, str] = {}
    replace_all(tmp_path, "new", found=found)
    assert found == {"out/report.json": "mine"}


def test_undoing_follows_no_link(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    for name in ("own", "old"):
        folder = tmp_path / "out" / UNFINISHED / name / "pictures"
        folder.mkdir(parents=True)
        (folder / "one.png").write_text("")
    (tmp_path / "out" / "pictures").symlink_to(victim)
    with pytest.raises(DatasetError, match="pictures: expected a folder"):
        replace_all(tmp_path, "new")
    assert list(victim.iterdir()) == []


def _die_at(number: int) -> None:
    import sys

    left = [number]

    def hook(event: str, args: tuple[object, ...]) -> None:
        if event in ("os.rename", "os.remove", "os.mkdir", "os.link", "os.rmdir"):
            if left[0] == 0:
                os._exit(9)
            left[0] -= 1

    sys.addaudithook(hook)


def test_a_file_that_was_to_be_last_must_be_written(tmp_path: Path) -> None:
    def forget() -> None:
        with replace_files(tmp_path / "out", last="report.json") as staged:
            (staged / "other").write_text("")

    with pytest.raises(ValueError, match=r"report\.json, which says that the files are whole"):
        forget()
    assert not (tmp_path / "out").exists()


def test_two_commands_do_not_write_at_once(tmp_path: Path) -> None:
    with (
        replace_files(tmp_path / "out", last=None),
        pytest.raises(DatasetError, match="another command is writing there"),
    ):
        write(tmp_path / "out", "other")


def test_links_and_folders_in_the_way_are_refused(tmp_path: Path) -> None:
    out, victim = tmp_path / "out", tmp_path / "victim"
    victim.mkdir()
    out.mkdir()
    (out / "pictures").symlink_to(victim)
    with pytest.raises(DatasetError, match="pictures: expected a folder"):
        write(out, "new")
    (out / "pictures").unlink()
    (out / "report.json").mkdir()
    with pytest.raises(DatasetError, match=r"report\.json: is a folder; expected a file"):
        write(out, "new")
    (out / "report.json").rmdir()
    os.mkfifo(out / "report.json")  # as /dev/null and /dev/stdout
    with pytest.raises(DatasetError, match=r"report\.json: is a device or a pipe"):
        write(out, "new")
    (out / "report.json").unlink()
    (out / UNFINISHED).symlink_to(victim)
    with pytest.raises(DatasetError, match="cannot be written"):
        write(out, "new")
    (out / UNFINISHED).unlink()
    (out / "table.csv").symlink_to(victim / "file")
    write(out, "new")
    assert read(out) == expected("new")
    assert list(victim.iterdir()) == []

    def link() -> None:
        with replace_files(out, last=None) as staged:
            (staged / "table.csv").symlink_to(victim)

    with pytest.raises(DatasetError, match=r"table\.csv: is a link"):
        link()


@pytest.mark.parametrize("name", ["", "pairs", "pairs/new"])
def test_nothing_goes_into_a_dataset(tmp_path: Path, name: str) -> None:
    (tmp_path / "dataset.json").write_text("{}")
    (tmp_path / "pairs").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "pairs")
    for place in (tmp_path / name, tmp_path / "link"):
        with pytest.raises(DatasetError, match="is in the dataset"):
            write(place, "new")
    file = Place(tmp_path / "dataset.json", is_file=True)
    with pytest.raises(DatasetError, match="is in the dataset"), replace_together([file]):
        pytest.fail("is never reached")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["dataset.json", "link", "pairs"]


def test_a_place_is_vacant_with_what_a_killed_command_left(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert is_vacant(out)
    (out / UNFINISHED / "new").mkdir(parents=True)
    assert is_vacant(out)
    (out / "mine").write_text("")
    assert not is_vacant(out)
    assert not is_vacant(out / "mine")


def test_what_a_user_put_where_files_grow_is_named_and_stays(tmp_path: Path) -> None:
    notes = tmp_path / UNFINISHED / "notes.txt"
    notes.parent.mkdir()
    notes.write_text("mine")
    with (
        pytest.raises(DatasetError, match=r"notes\.txt: was not written by these commands"),
        replace_files(tmp_path, last=None) as staged,
    ):
        (staged / "a").write_text("new")
    assert notes.read_text() == "mine"
    assert not (tmp_path / "a").exists()


def test_what_a_killed_command_within_another_left_is_removed(tmp_path: Path) -> None:
    """Belief tables are written into what `bsg-belief` writes: the lock of `new` lies beside it."""
    unfinished = tmp_path / UNFINISHED
    (unfinished / "scratch").mkdir(parents=True)
    (unfinished / ".new.lock").touch()
    with replace_files(tmp_path, last=None) as staged:
        (staged / "a").write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
