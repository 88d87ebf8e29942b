"""A dataset that is changed is whole at every moment, whatever stops or meets the change."""

from __future__ import annotations

import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pytest

from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import Manifest, encode_manifest, read_manifest
from bsg_data.dataset.revision import remove_left, revise
from bsg_data.dataset.schema import SPLITS
from bsg_data.dataset.shards import describe_file, open_parquet
from bsg_data.dataset.splits import read_splits, split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe

FOLDS = SplitRecipe(method="folds", ratios=None, folds=3)


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def split_anew(dataset: Path) -> Manifest:
    return split_dataset(dataset, FOLDS, force=True)


def pair_anew(dataset: Path) -> Manifest:
    return write_pairs(dataset, PairsRecipe(draws=2), force=True)


@pytest.mark.parametrize(("one", "other"), [(split_anew, pair_anew), (pair_anew, split_anew)])
def test_a_second_command_is_refused_from_the_reading_of_the_manifest_on(
    dataset: Path,
    monkeypatch: pytest.MonkeyPatch,
    one: Callable[[Path], Manifest],
    other: Callable[[Path], Manifest],
) -> None:
    """Whoever read the manifest before the other wrote it would put the old one back."""
    refused = []

    def read_and_meet(folder: Path) -> Manifest:
        manifest = read_manifest(folder)
        with (
            ThreadPoolExecutor(1) as pool,
            pytest.raises(DatasetError, match="another command is writing there") as caught,
        ):
            pool.submit(other, folder).result()
        refused.append(caught)
        return manifest

    monkeypatch.setattr("bsg_data.dataset.revision.read_manifest", read_and_meet)
    made = one(dataset)
    assert len(refused) == 1
    assert check_dataset(dataset) == ()
    assert read_manifest(dataset) == made


def test_pairs_and_split_as_two_processes_leave_a_sound_dataset(dataset: Path) -> None:
    code = "from bsg_cli.data import main; main()"
    command = [sys.executable, "-c", code]
    options = {"split": ["--folds", "3"], "pairs": ["--draws", "300", "--workers", "1"]}
    running = [
        subprocess.Popen(
            [*command, name, str(dataset), *some, "--force"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for name, some in options.items()
    ]
    for process in running:
        _, errors = process.communicate()
        if process.returncode:
            assert "another command is writing there" in errors
    assert check_dataset(dataset) == ()
    assert not (dataset.parent / f".{dataset.name}.lock").exists()


@pytest.mark.parametrize("change", [split_anew, pair_anew])
@pytest.mark.parametrize("late", [False, True])
def test_an_error_at_any_rename_leaves_the_old_dataset(
    dataset: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], Manifest], late: bool
) -> None:
    """It fails, or Ctrl-C comes when it is done."""
    before, renames = all_bytes(dataset), 0
    fail_at: int | None = None

    def failing(rename: Callable[[Path, Path], Path]) -> Callable[[Path, Path], Path]:
        def call(path: Path, target: Path) -> Path:
            nonlocal renames
            renames += 1
            if renames == fail_at and not late:
                raise OSError(5, "Input/output error")
            renamed = rename(path, target)
            if renames == fail_at:
                raise KeyboardInterrupt
            return renamed

        return call

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", failing(Path.rename))
        patch.setattr(Path, "replace", failing(Path.replace))
        for step in range(1, 100):
            renames, fail_at = 0, step
            with suppress(DatasetError, KeyboardInterrupt):
                change(dataset)
                break
            assert all_bytes(dataset) == before
    assert step > 12  # cards and manifest twice, old files out, new files in
    assert all_bytes(dataset) != before
    assert check_dataset(dataset) == ()


KILLED = """
import os, sys
from pathlib import Path
from bsg_data import PairsRecipe, SplitRecipe, split_dataset, write_pairs

def killing(rename, at):
    def call(path, target):
        steps.append(path)
        if len(steps) == at:
            os._exit(9)
        return rename(path, target)
    return call

dataset, copies = Path(sys.argv[1]), Path(sys.argv[2])
folds = SplitRecipe(method="folds", ratios=None, folds=3)
plain, plain_replace = Path.rename, Path.replace
for at in range(1, 100, int(sys.argv[4])):
    copy = copies / f"{at:02d}"
    os.system(f"cp -r '{dataset}' '{copy}'")
    child = os.fork()
    if not child:
        steps = []
        Path.rename, Path.replace = killing(plain, at), killing(plain_replace, at)
        if sys.argv[3] == "split":
            split_dataset(copy, folds, force=True)
        else:
            write_pairs(copy, PairsRecipe(draws=2), force=True)
        os._exit(0)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0:
        break
"""


@pytest.mark.parametrize(("command", "change"), [("split", split_anew), ("pairs", pair_anew)])
def test_a_process_killed_at_any_rename_leaves_a_true_manifest(
    dataset: Path, tmp_path: Path, command: str, change: Callable[[Path], Manifest], stride: int
) -> None:
    copies = tmp_path / "copies"
    copies.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(dataset), str(copies), command, str(stride)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    expected = all_bytes(sorted(path for path in copies.iterdir() if path.is_dir())[-1])
    killed = sorted(path for path in copies.iterdir() if path.is_dir())[:-1]
    assert len(killed) > 12 // stride
    with_old = 0
    for copy in killed:
        manifest = read_manifest(copy)
        for entry in manifest.files:
            assert describe_file(copy, entry.path, rows=entry.rows) == entry
        faults = check_dataset(copy)
        assert faults, "whatever a killed command left is named"
        strays = {f for f in faults if f.what.startswith("is not in the manifest")}
        assert strays, "and also where a card and the manifest were renamed apart"
        assert {f.where for f in faults if f not in strays} <= {"README.md", "croissant.json"}
        with_old += manifest.pairs is not None and manifest == read_manifest(dataset)
        change(copy)
        assert all_bytes(copy) == expected
    assert with_old > 3 // stride


def test_a_full_disk_leaves_the_old_pairs(dataset: Path) -> None:
    """A file that cannot grow stands for a full disk: the write fails in the same place."""

    def limit_file_size() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    before = all_bytes(dataset)
    code = "from bsg_cli.data import main; main()"
    command = [sys.executable, "-c", code, "pairs", str(dataset), "--force", "--workers", "1"]
    done = subprocess.run(
        [*command, "--draws", "2000"], capture_output=True, text=True, preexec_fn=limit_file_size
    )
    assert done.returncode == 1
    assert "cannot be written" in done.stderr
    assert "Traceback" not in done.stderr
    assert all_bytes(dataset) == before


def test_files_of_the_users_stay(dataset: Path) -> None:
    (dataset / "pairs" / "notes.txt").write_text("mine")
    split_dataset(dataset, FOLDS, force=True)
    assert (dataset / "pairs" / "notes.txt").read_text() == "mine"
    write_pairs(dataset, PairsRecipe(draws=1))
    (fault,) = check_dataset(dataset)
    assert fault.where == "pairs/notes.txt"


def test_a_damaged_file_is_replaced_although_the_manifest_stays_the_same(dataset: Path) -> None:
    before, manifest = all_bytes(dataset), read_manifest(dataset)
    (dataset / "pairs" / "val-00000.parquet").write_bytes(b"PAR1")
    assert manifest.pairs is not None
    write_pairs(dataset, manifest.pairs, force=True)
    assert all_bytes(dataset) == before


def test_links_in_a_dataset_lead_nowhere(dataset: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    shutil.move(dataset / "pairs", outside)
    (dataset / "pairs").symlink_to(outside)
    before = all_bytes(outside)
    with pytest.raises(DatasetError, match="pairs: is a link"):
        write_pairs(dataset, PairsRecipe(draws=1), force=True)
    assert all_bytes(outside) == before
    (dataset / "pairs").unlink()
    (dataset / ".revision").symlink_to(outside)
    with pytest.raises(DatasetError, match="cannot be removed"):
        split_dataset(dataset, FOLDS, force=True)
    assert all_bytes(outside) == before


def test_no_split_is_read_that_leads_out_of_the_dataset(dataset: Path, tmp_path: Path) -> None:
    """The hash in the manifest is right, so that only the name itself can give it away."""
    (tmp_path / "victim").mkdir()
    manifest = read_manifest(dataset)
    scenes = [scene for some in read_splits(dataset).values() for scene in some]
    for name in ("../../victim/evil", "/etc/evil", "training", "fold-", "fold-1/x", "train\n", ""):
        splits = [name, *["train"] * (len(scenes) - 1)]
        table = pa.Table.from_pydict({"scene_id": scenes, "split": splits}, schema=SPLITS)
        with open_parquet(
            dataset / "splits.parquet", SPLITS, table="splits", class_space=manifest.class_space
        ) as writer:
            writer.write_table(table)
        entry = describe_file(dataset, "splits.parquet", rows=len(table))
        repaired = manifest.with_table("splits", (entry,))
        (dataset / "dataset.json").write_bytes(encode_manifest(repaired))
        with pytest.raises(DatasetError, match="expected train, val, test or fold-N"):
            write_pairs(dataset, PairsRecipe(draws=1), force=True)
    assert list((tmp_path / "victim").iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset", "victim"]


def test_a_revision_needs_a_dataset(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no such folder"):
        revise(tmp_path / "none", lambda manifest, folder: manifest)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_a_killed_command_emptied_goes_with_the_next(dataset: Path) -> None:
    """Killed between the last file of the pairs and the end, a new split left their folder."""
    for path in (dataset / "pairs").iterdir():
        path.unlink()
    split_anew(dataset)
    assert not (dataset / "pairs").exists()


def test_a_folder_that_was_made_in_vain_goes(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pairs of a dataset that had none could not be put in place."""
    split_anew(dataset)

    def fail(path: Path, target: Path) -> Path:
        raise OSError(28, f"no room for {target}")

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(DatasetError, match="no room"):
        write_pairs(dataset, PairsRecipe(draws=2))
    assert not (dataset / "pairs").exists()


def test_what_a_killed_change_left_is_removed_without_another_change(dataset: Path) -> None:
    before = sorted(dataset.rglob("*"))
    remove_left(dataset)
    for name in ("new", "old", "rest"):
        (dataset / ".revision" / name).mkdir(parents=True)
    shutil.copy(dataset / "splits.parquet", dataset / ".revision" / "old")
    remove_left(dataset)
    assert sorted(dataset.rglob("*")) == before
    (dataset / ".revision").mkdir()
    (dataset / ".revision" / "mine.txt").write_text("mine")
    with pytest.raises(DatasetError, match=r"mine\.txt, which this program did not write"):
        remove_left(dataset)
