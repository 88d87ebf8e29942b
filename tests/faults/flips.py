"""Bytes that are flipped, one at a time, in every file of a folder."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path

from bsg_data.errors import BSGError


def choose_flips(folder: Path, number: int, *, seed: int) -> Iterator[tuple[Path, int, int]]:
    """Yield file, place and what its byte is changed by: every file in turn, its ends first."""
    rng = random.Random(seed)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    for turn in range(number):
        path = files[turn % len(files)]
        last = path.stat().st_size - 1
        place = {0: 0, 1: last}.get(turn // len(files), rng.randint(0, last))
        # Half of them change one bit, as a disk does; the others anything.
        yield path, place, 1 << rng.randrange(8) if rng.random() < 0.5 else rng.randint(1, 255)


def find_missed(
    folder: Path, number: int, look: Callable[[], bool], *, seed: int = 0
) -> tuple[str, ...]:
    """Flip bytes one at a time, and return those that nobody found, or found by a traceback.

    Args:
        folder: of the files; each is as it was afterwards.
        number: of flips.
        look: says whether anything is wrong, or raises an error of ours.
        seed: of the flips.
    """
    missed = []
    for path, place, change in choose_flips(folder, number, seed=seed):
        whole = path.read_bytes()
        flipped = bytearray(whole)
        flipped[place] ^= change
        path.write_bytes(flipped)
        where = f"{path.relative_to(folder)}: byte {place} of {len(whole)}, changed by {change}"
        try:
            if not look():
                missed.append(where)
        except BSGError:
            pass
        except Exception as error:
            missed.append(f"{where}: {error!r}")
        finally:
            path.write_bytes(whole)
    return tuple(missed)
