"""A byte that is flipped anywhere in what we have written is found by whoever reads it."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

from bsg_data.checks.dataset import check_dataset
from bsg_data.errors import BSGError
from bsg_data.seal import require_seal
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config

CARDS = ("README.md", "croissant.json")  # of a dataset: they follow from its manifest, unhashed


def find_missed(folder: Path, look: Callable[[], bool], *, full: bool) -> list[str]:
    """Flip bytes one at a time, and return those that nobody found, or found by a traceback.

    Args:
        folder: of the files; each is as it was afterwards.
        look: says whether anything is wrong, or raises an error of ours.
        full: whether many bytes are flipped.
    """
    assert not look()
    missed = []
    for path, index, change in _choose(folder, 1_000 if full else 40):
        whole = path.read_bytes()
        flipped = bytearray(whole)
        flipped[index] ^= change
        path.write_bytes(flipped)
        where = f"{path.relative_to(folder)}: byte {index} of {len(whole)}, changed by {change}"
        try:
            if not look():
                missed.append(where)
        except BSGError:
            pass
        except Exception as error:
            missed.append(f"{where}: {error!r}")
        finally:
            path.write_bytes(whole)
    return missed


def _choose(folder: Path, number: int) -> Iterator[tuple[Path, int, int]]:
    """Yield file, index and what its byte is changed by: every file in turn, its ends first."""
    rng = random.Random(0)
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name not in CARDS)
    for turn in range(number):
        path = files[turn % len(files)]
        last = path.stat().st_size - 1
        index = {0: 0, 1: last}.get(turn // len(files), rng.randint(0, last))
        # Half of them change one bit, as a disk does; the others anything.
        yield path, index, 1 << rng.randrange(8) if rng.random() < 0.5 else rng.randint(1, 255)


def test_in_a_dataset(dataset: Path, full: bool) -> None:
    assert find_missed(dataset, lambda: bool(check_dataset(dataset)), full=full) == []


def test_in_a_run(dataset: Path, tmp_path: Path, full: bool) -> None:
    run = tmp_path / "run"
    small = ["model.width=4", "training.epochs=1"]
    tables = override(find_config("ceci").model_dump(mode="json"), small)
    train_run(validate_config(tables, source="test"), dataset, run)
    assert {*(require_seal(run) or ()), "SHA256SUMS"} == {path.name for path in run.iterdir()}
    assert find_missed(run, lambda: not require_seal(run), full=full) == []
