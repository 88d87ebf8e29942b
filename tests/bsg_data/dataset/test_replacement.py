"""A dataset takes the place of another one: at every moment one of them is there, or both are."""

from __future__ import annotations

import errno
import os
import shutil
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset import replacement
from bsg_data.dataset.growth import finish, open_partial, recall
from bsg_data.dataset.manifest import hash_manifest, read_manifest
from bsg_data.dataset.publication import RECIPE, REPLACES
from bsg_data.dataset.replacement import (
    find_replaced,
    is_settled,
    name_growing,
    name_replaced,
    settle,
)
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.recipes import SplitRecipe
from bsg_data.sources.hm3d import HM3DFolder

OLD, NEW = SplitRecipe(seed=1), SplitRecipe(seed=2)  # any records do as recipes


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture
def other(dataset: Path, tmp_path: Path) -> Path:
    """A dataset of the same buildings with another split."""
    other = tmp_path / "other"
    shutil.copytree(dataset, other)
    split_dataset(other, NEW, force=True)
    return other


def grow(folder: Path, old: Path, new: Path) -> Path:
    """Lay out a dataset, and beside it a finished one that is about to replace it."""
    folder.mkdir()
    out = folder / "out"
    shutil.copytree(old, out)
    growing = open_partial(out, NEW)
    for path in new.rglob("*.parquet"):
        target = growing / path.relative_to(new)
        target.parent.mkdir(exist_ok=True)
        shutil.copy(path, target)
    return out


def never(one: Path, other: Path) -> bool:
    return False


def die_at(number: int) -> None:
    """End this process before it changes a name for the n-th time."""
    left = [number]

    def hook(event: str, args: tuple[object, ...]) -> None:
        if event in ("os.rename", "os.remove", "os.mkdir", "os.rmdir"):
            if left[0] == 0:
                os._exit(9)
            left[0] -= 1

    sys.addaudithook(hook)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # threads of Arrow stay behind
@pytest.mark.parametrize("exchanges", [True, False])
def test_killed_at_any_change_a_dataset_is_there_and_the_next_command_ends_it(
    dataset: Path,
    other: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stride: int,
    exchanges: bool,
) -> None:
    if not exchanges:
        monkeypatch.setattr(replacement, "exchange", never)
    before, after = all_bytes(dataset), all_bytes(other)
    manifest = read_manifest(other)
    absent = named = 0
    for number in range(0, 200, stride):
        out = grow(tmp_path / str(number), dataset, other)
        child = os.fork()
        if not child:
            die_at(number)
            finish(out, manifest, force=True)
            os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0:
            break
        absent += not out.exists()
        if out.exists():
            left = {name: data for name, data in all_bytes(out).items() if ".reports" not in name}
            assert left in (before, after)
            old = find_replaced(out)
            named += old is not None
            if number % 8 == 0:
                told = " ".join(fault.what for fault in check_dataset(out))
                assert bool(told) == (out / RECIPE).is_file()
                assert old is None or str(old) in told
        known = (out / RECIPE).is_file() or not out.exists()
        assert (recall(out, NEW) == manifest) == known
        if all_bytes(out) == before:
            finish(out, manifest, force=True)
        assert all_bytes(out) == after
        assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert number > 30
    assert named > 15 // stride  # the files of the old one go one by one
    assert absent <= (0 if exchanges else 1)
    assert absent or exchanges or stride > 1  # a third of the moments may leave out that one


@pytest.mark.parametrize("command", ["split", "build", "settle"])
def test_any_next_command_ends_what_was_begun(
    dataset: Path,
    other: Path,
    hm3d_folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
) -> None:
    out = grow(tmp_path / "here", dataset, other)
    monkeypatch.setattr("bsg_data.dataset.replacement.settle", lambda out: None)  # as if killed
    finish(out, read_manifest(other), force=True)
    monkeypatch.undo()
    assert find_replaced(out) == name_growing(out)
    assert not is_settled(out)
    acts: dict[str, Callable[[], object]] = {
        "split": lambda: split_dataset(out, OLD, force=True),
        "build": lambda: build_dataset(HM3DFolder(hm3d_folder), out, force=True),
        "settle": lambda: settle(out),
    }
    acts[command]()
    assert check_dataset(out) == ()
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_what_is_no_dataset_that_was_replaced_is_never_removed(
    dataset: Path, other: Path, tmp_path: Path
) -> None:
    out = grow(tmp_path / "here", dataset, other)
    for name in (".out.replaced", "mine.partial"):
        shutil.copytree(dataset, out.with_name(name))
    with pytest.raises(DatasetError, match=r"\.out\.replaced: is in the way; move it away"):
        finish(out, read_manifest(other), force=True)
    assert all_bytes(out) == all_bytes(dataset)
    settle(out)
    settle(out.with_name("mine"))
    for name in (".out.replaced", "mine.partial"):
        assert all_bytes(out.with_name(name)) == all_bytes(dataset)


@pytest.mark.parametrize("where", ["thesis.tex", ".reports/notes", ".revision/notes", "pairs/mine"])
def test_a_users_file_in_the_old_or_the_new_dataset_is_named_and_stays(
    dataset: Path, other: Path, tmp_path: Path, where: str
) -> None:
    for place in ("out", "out.partial"):
        out = grow(tmp_path / f"in {place}", dataset, other)
        mine = out.with_name(place) / where
        mine.parent.mkdir(exist_ok=True)
        mine.write_text("years of work")
        with pytest.raises(DatasetError, match=f"holds {where}"):
            finish(out, read_manifest(other), force=True)
        assert mine.read_text() == "years of work"
        with (
            pytest.raises(DatasetError, match=f"holds {where}") if place != "out" else nullcontext()
        ):
            open_partial(out, OLD)
        assert mine.read_text() == "years of work"


def test_a_rename_that_fails_leaves_the_old_dataset(
    dataset: Path, other: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = grow(tmp_path / "here", dataset, other)
    monkeypatch.setattr(replacement, "exchange", never)
    rename = Path.rename

    def fail(path: Path, target: Path) -> Path:
        if path == name_growing(out):
            raise OSError(5, "Input/output error")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(DatasetError, match=r"the finished dataset is .*out\.partial"):
        finish(out, read_manifest(other), force=True)
    assert all_bytes(out) == all_bytes(dataset)


def test_the_root_of_the_file_system_is_no_place() -> None:
    for name in (name_growing, name_replaced):
        with pytest.raises(DatasetError, match="cannot be a dataset"):
            name(Path("/"))


def test_a_pipe_in_the_place_of_a_report_is_not_waited_for(dataset: Path) -> None:
    shutil.copytree(dataset, name_growing(dataset))
    (dataset / REPLACES).parent.mkdir()
    os.mkfifo(dataset / REPLACES)
    assert find_replaced(dataset) is None
    assert [fault.where for fault in check_dataset(dataset)] == [REPLACES]


def test_a_manifest_larger_than_any_is_of_nothing_replaced(dataset: Path) -> None:
    old = name_replaced(dataset)
    old.mkdir()
    (old / "dataset.json").touch()
    os.truncate(old / "dataset.json", 65 * 2**20)
    (name_growing(dataset) / REPLACES).parent.mkdir(parents=True)
    (name_growing(dataset) / REPLACES).write_text("0" * 64)
    assert is_settled(dataset)


def test_what_cannot_be_read_is_neither_removed_nor_forgotten(
    dataset: Path, other: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that fails for a moment: the next command still knows which dataset may go."""
    out = grow(tmp_path / "here", dataset, other)

    def fail(_: Path) -> str:
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as broken:
        broken.setattr(replacement, "remove_own", lambda *_, **__: fail(out))
        with pytest.raises(OSError, match="Input/output error"):
            finish(out, read_manifest(other), force=True)
    with monkeypatch.context() as broken:
        broken.setattr(replacement, "hash_manifest", fail)
        with pytest.raises(DatasetError, match=r"cannot be read .Input/output error"):
            settle(out)
    settle(out)
    assert all_bytes(out) == all_bytes(other)
    assert [path.name for path in out.parent.iterdir()] == ["out"]


def test_a_recipe_larger_than_any_is_refused(dataset: Path) -> None:
    recipe = name_growing(dataset) / RECIPE
    recipe.parent.mkdir(parents=True)
    recipe.touch()
    os.truncate(recipe, 100 * 2**30)
    with pytest.raises(DatasetError, match=r"recipe\.json: 107,374,182,400 bytes; .* move it away"):
        open_partial(dataset, NEW)


@pytest.mark.parametrize("name", [".", "..", "link", "out/../out"])
def test_what_was_begun_is_found_by_any_name_of_the_dataset(
    dataset: Path, other: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    out = grow(tmp_path / "here", dataset, other)
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "link").symlink_to(out)
    monkeypatch.setattr("bsg_data.dataset.replacement.settle", lambda out: None)  # as if killed
    finish(out, read_manifest(other), force=True)
    monkeypatch.undo()
    stand = {".": out, "..": out / "scenes", "link": tmp_path / "there"}
    monkeypatch.chdir(stand.get(name, out.parent))
    named = Path(name)
    assert find_replaced(named) == name_growing(out)
    assert not is_settled(named)
    split_dataset(named, OLD, force=True)
    assert is_settled(named)
    assert check_dataset(named) == ()
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert (tmp_path / "there" / "link").is_symlink()


def test_a_dataset_that_a_link_led_to_comes_back_where_it_was(
    dataset: Path, other: Path, tmp_path: Path
) -> None:
    out = grow(tmp_path / "here", dataset, other)
    (tmp_path / "link").symlink_to(out)
    (name_growing(out) / REPLACES).write_text(hash_manifest(out))
    out.rename(name_replaced(out))  # killed between two renames
    with pytest.raises(DatasetError, match=r"out\.partial beside it"):
        read_manifest(tmp_path / "link")
    settle(tmp_path / "link")
    assert out.is_dir()
    assert (tmp_path / "link").is_symlink()
