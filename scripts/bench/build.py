"""Measure what building a dataset takes with two workers beside one.

    python scripts/bench/build.py                       # of 512 buildings
    python scripts/bench/build.py --buildings 2000

One worker is this process; two are processes of a pool that has started already, as in a long
build. Both write the same bytes.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from pathlib import Path

from timing import Speed, print_speeds, time_both

from bsg_data.build import build_dataset
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

WORKERS = 2


def measure(*, buildings: int = 512) -> Iterator[Speed]:
    """Yield what a build takes with two workers and with one."""
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(WORKERS) as pool:
        raw = Path(folder, "raw")
        list(write_synthetic(raw, scenes=buildings, seed=0, executor=pool))
        build(raw, Path(folder, "started"), pool)
        both, one = time_both(
            lambda: build(raw, Path(folder, "both"), pool),
            lambda: build(raw, Path(folder, "one"), None),
            repeats=2,
        )
    yield Speed(
        what=f"a build of {buildings} buildings with {WORKERS} workers",
        against="the same with one",
        ours_s=both,
        theirs_s=one,
        target=1.8,
        at_least=True,
    )


def build(raw: Path, out: Path, pool: Executor | None) -> None:
    """Build a dataset anew."""
    build_dataset(HM3DFolder(raw), out, force=True, executor=pool)


def main() -> None:
    """Print the row."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--buildings", type=int, default=512)
    print_speeds(measure(buildings=parser.parse_args().buildings))


if __name__ == "__main__":
    main()
