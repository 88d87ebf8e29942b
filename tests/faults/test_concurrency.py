"""Two commands on one dataset: one wins, the other says so, and some serial order gives the same.

In short, one command runs inside the transaction of the other: when it has the lock, and before it
gives the lock back. In full, pairs of processes race, too.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import combinations_with_replacement, product
from pathlib import Path

import pytest

from bsg_data import (
    PairsRecipe,
    SplitRecipe,
    build_dataset,
    check_dataset,
    export_dataset,
    merge_datasets,
    read_manifest,
    split_dataset,
    write_pairs,
    write_synthetic,
)
from bsg_data.errors import DatasetError
from bsg_data.extend import HM3DFolder, count_frequencies
from bsg_data.lock import hold

pytestmark = pytest.mark.heavy

Act = Callable[[Path], object]  # on a folder with `dataset`, `other` and `hm3d`
FOLDS = SplitRecipe(method="folds", ratios=None, folds=3)


def _export(at: Path) -> None:
    with pytest.raises(DatasetError, match=r"none of its 1[23] scenes has anything"):
        export_dataset(at / "dataset", at / "regions", to="habitat")


WRITERS: dict[str, Act] = {
    "build --force": lambda at: build_dataset(HM3DFolder(at / "hm3d"), at / "dataset", force=True),
    "split --force": lambda at: split_dataset(at / "dataset", FOLDS, force=True),
    "pairs --force": lambda at: write_pairs(at / "dataset", PairsRecipe(draws=1), force=True),
    "merge --force": lambda at: merge_datasets(
        [at / "other", at / "dataset"], at / "dataset", force=True
    ),
}
READERS: dict[str, Act] = {
    "check": lambda at: check_dataset(at / "dataset"),
    "info": lambda at: count_frequencies(at / "dataset"),
    "export": _export,
}
PLACES = ("dataset.commit", "synthetic.buildings")


@pytest.fixture
def place(dataset: Path, hm3d_folder: Path, tmp_path: Path) -> Path:
    """A folder with a dataset that is split and has pairs, another one, and a source."""
    other = tmp_path / "others"
    list(write_synthetic(other, scenes=1, seed=1))
    build_dataset(HM3DFolder(other), tmp_path / "other")
    return tmp_path


def meet(monkeypatch: pytest.MonkeyPatch, act: Callable[[], object], *, at_the_end: bool) -> None:
    """Have the first command that gets a lock run something while it has it."""
    met: list[Path] = []

    @contextmanager
    def hold_and_meet(folder: Path, *, wait: float = 0.0) -> Iterator[None]:
        with hold(folder, wait=wait):
            first = not met
            met.append(folder)
            if first and not at_the_end:
                act()
            yield
            if first and at_the_end:
                act()

    for name in PLACES:
        monkeypatch.setattr(f"bsg_data.{name}.hold", hold_and_meet)


@pytest.mark.parametrize("one", WRITERS)
def test_a_command_in_the_middle_of_another(
    one: str, place: Path, monkeypatch: pytest.MonkeyPatch, full: bool
) -> None:
    misses = []
    ends = (False, True) if full else (False,)
    for number, (other, at_the_end) in enumerate(product([*WRITERS, *READERS], ends)):
        at = place.with_name(f"{place.name}-{number}")
        shutil.copytree(place, at)
        said: list[str] = []

        def run_other(other: str = other, at: Path = at, said: list[str] = said) -> None:
            try:
                with ThreadPoolExecutor(1) as pool:
                    pool.submit((WRITERS | READERS)[other], at).result()
            except DatasetError as error:
                said.append(str(error))

        with monkeypatch.context() as patch:
            meet(patch, run_other, at_the_end=at_the_end)
            made = WRITERS[one](at)
        # A merge of what is merged already is refused for its buildings, before it asks for a lock.
        refused = ("another command is writing there", "is in")
        if other in WRITERS and not any(word in some for some in said for word in refused):
            misses.append(f"{other} in {one}: was not refused")
        if other in READERS and said:
            misses.append(f"{other} in {one}: {said[0]}")
        misses += [f"{other} in {one}: {f.where}: {f.what}" for f in check_dataset(at / "dataset")]
        if read_made(at) != made:
            misses.append(f"{other} in {one}: the dataset is not what {one} made")
        shutil.rmtree(at)
    assert misses == []


def read_made(at: Path) -> object:
    return read_manifest(at / "dataset")


def test_two_sets_of_synthetic_buildings_do_not_mix(tmp_path: Path) -> None:
    out = tmp_path / "buildings"
    writing = write_synthetic(out, scenes=3, seed=1)
    next(writing)
    with pytest.raises(DatasetError, match="another command is writing there"):
        write_synthetic(out, scenes=3, seed=2, force=True)
    list(writing)
    assert len(list(out.rglob("*.semantic.txt"))) == 3


LINES = {
    "build --force": "build --hm3d hm3d --out dataset --workers 1 --force",
    "split --force": "split dataset --folds 3 --force",
    "pairs --force": "pairs dataset --draws 3 --workers 1 --force",
    "merge --force": "merge other dataset --out dataset --force",
    "synth --force": "synth --out hm3d-new --scenes 5 --workers 1 --force",
}
ROUNDS = 5


@pytest.mark.parametrize(("one", "other"), list(combinations_with_replacement(LINES, 2)))
def test_two_processes_race(one: str, other: str, place: Path, full: bool) -> None:
    if not full:
        pytest.skip("races are run in full, by `make faults`")
    misses = []
    for number in range(ROUNDS):
        at = place.with_name(f"{place.name}-{number}")
        shutil.copytree(place, at)
        code = "from bsg_cli.data import main; main()"
        running = [
            subprocess.Popen(
                [sys.executable, "-c", code, *LINES[name].split()],
                cwd=at,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
            for name in (one, other)
        ]
        ended = [(process.communicate()[1], process.returncode) for process in running]
        if all(returned for _, returned in ended):
            misses.append(f"{one} and {other}, round {number}: none won")
        misses += [
            f"{one} and {other}, round {number}: {said.strip()}"
            for said, returned in ended
            if "Traceback" in said or returned not in (0, 1)
        ]
        faults = check_dataset(at / "dataset")
        misses += [f"{one} and {other}, round {number}: {f.where}: {f.what}" for f in faults]
        left = [path.name for path in at.iterdir() if path.name.startswith(".")]
        misses += [f"{one} and {other}, round {number}: leaves {name}" for name in left]
        shutil.rmtree(at)
    assert misses == []
