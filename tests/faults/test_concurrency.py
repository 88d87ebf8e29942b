"""Two commands on one folder: one wins, the other says so, and nothing is a mix.

One command runs inside the other: when that has the lock, or while it works.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from one_building import read_pairs

from bsg_data import (
    Dataset,
    PairsRecipe,
    SplitRecipe,
    build_dataset,
    check_dataset,
    merge_datasets,
    read_manifest,
    split_dataset,
    write_pairs,
    write_synthetic,
)
from bsg_data.errors import BSGError, DatasetError
from bsg_data.files import hold
from bsg_data.sources.hm3d import HM3DFolder

pytestmark = pytest.mark.heavy

Act = Callable[[Path], object]  # on a folder with `dataset`, `other` and `hm3d`
FOLDS = SplitRecipe(method="folds", ratios=None, folds=3)
WRITERS: dict[str, Act] = {
    "build": lambda at: build_dataset(HM3DFolder(at / "hm3d"), at / "dataset", force=True),
    "split": lambda at: split_dataset(at / "dataset", FOLDS, force=True),
    "merge": lambda at: merge_datasets([at / "other", at / "dataset"], at / "dataset", force=True),
}
READERS: dict[str, Act] = {"check": lambda at: check_dataset(at / "dataset")}


@pytest.fixture
def place(dataset: Path, hm3d_folder: Path, tmp_path: Path) -> Path:
    """A folder with a dataset that is split and has pairs, another one, and a source."""
    list(write_synthetic(tmp_path / "others", scenes=1, seed=1))
    build_dataset(HM3DFolder(tmp_path / "others"), tmp_path / "other")
    return tmp_path


def meet(monkeypatch: pytest.MonkeyPatch, act: Callable[[], object]) -> None:
    """Have the first command that gets a dataset's lock run something while it has it."""
    met: list[Path] = []

    @contextmanager
    def hold_and_meet(folder: Path) -> Iterator[None]:
        with hold(folder):
            met.append(folder)
            if len(met) == 1:
                act()
            yield

    for module in ("bsg_data.dataset.commit", "bsg_data.results"):  # of a change, and of a build
        monkeypatch.setattr(f"{module}.hold", hold_and_meet)


@pytest.mark.parametrize("one", WRITERS)
@pytest.mark.parametrize("other", [*WRITERS, *READERS])
def test_a_command_in_the_middle_of_another(
    one: str, other: str, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[BSGError] = []

    def act() -> None:
        try:
            with ThreadPoolExecutor(1) as pool:
                pool.submit((WRITERS | READERS)[other], place).result()
        except DatasetError as error:
            refused.append(error)

    with monkeypatch.context() as patch:
        meet(patch, act)
        made = WRITERS[one](place)
    assert len(refused) == (other in WRITERS)
    assert read_manifest(place / "dataset") == made
    assert check_dataset(place / "dataset") == ()


def test_a_reader_beside_a_writer_gets_the_old_or_the_new_or_an_error(dataset: Path) -> None:
    def read() -> tuple[object, ...]:
        data = Dataset.open(dataset)
        cells = [int(data.cells(scene).sum()) for scene in data.scene_ids]
        rows = [len(read_pairs(data, split)) for split in data.require_splits()]
        return cells, data.splits, rows

    found = [read()]
    with ThreadPoolExecutor(1) as pool:
        for draws in (1, 2, 3):
            work = pool.submit(write_pairs, dataset, PairsRecipe(draws=draws), force=True)
            while not work.done():
                with suppress(DatasetError):
                    found.append(read())
            old, new = found[0], read()
            assert all(one in (old, new) for one in found)
            assert old != new
            found = [new]
