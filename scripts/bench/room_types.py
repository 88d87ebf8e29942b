"""Lay the fit of room types that starts from a sample beside all of its rounds on all rooms.

    python scripts/bench/room_types.py --buildings 3000

Both fit the `mixture` of the zoo to four fifths of synthetic buildings, from the same seeds, and
are asked how likely the rooms of the other fifth are. What a start from a sample loses, if
anything, is to be seen beside how much two seeds differ.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from synthetic import build_synthetic

from bsg_data.tables import format_text
from bsg_models.zoo.complete_rooms import read_rooms
from bsg_models.zoo.mixture import MixtureConfig
from bsg_models.zoo.room_types import MOST, SAMPLE, Rooms, fit_types

HEADER = ("seed", "rooms", "seconds", "all rounds", "ratio", "log P of a room", "all rounds", "gap")


def compare(rooms: Rooms, others: Rooms, *, seed: int, sample: int) -> tuple[str, ...]:
    """Return the row of one seed, under `HEADER`.

    Args:
        rooms: `[R, C]` that types are fitted to.
        others: `[S, C]` that they are asked about.
        seed: of both fits.
        sample: rooms of the start.
    """
    config, seconds, found = MixtureConfig(), [], []
    for most in (sample, len(rooms)):
        began = time.process_time()
        fitted = fit_types(
            rooms,
            types=config.types,
            iterations=config.iterations,
            seed=seed,
            tilted=config.tilted,
            sample=most,
        )
        seconds.append(time.process_time() - began)
        found.append(float(fitted.log_probability(others).mean()))
    return (
        str(seed),
        f"{len(rooms):,}",
        *(f"{second:.2f}" for second in seconds),
        f"{seconds[0] / seconds[1]:.2f}",
        *(f"{one:.4f}" for one in found),
        f"{found[0] - found[1]:+.4f}",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--buildings", type=int, default=3000)
    parser.add_argument("--sample", type=int, default=SAMPLE, help="rooms of the start")
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        data = build_synthetic(Path(folder), scenes=options.buildings)
        counts, building = read_rooms(data, data.scene_ids, most=MOST)
    held_out = np.asarray(building % 5 == 0)
    rows = [
        compare(counts[~held_out], counts[held_out], seed=seed, sample=options.sample)
        for seed in range(options.seeds)
    ]
    print(format_text(rows, header=HEADER))


if __name__ == "__main__":
    main()
