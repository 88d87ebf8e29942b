"""Measure how fast the main jobs are beside what people would use instead, and write the tables.

    python scripts/bench/speed.py --hm3d PATH --out docs/results/figures.json
    python scripts/bench/speed.py --only masks search   # prints the rows of two

Each benchmark is a file of this folder, and runs in a process of its own with one thread.
"""

from __future__ import annotations

import argparse
import importlib
import multiprocessing
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from results import ResultsTable, write_figures
from timing import HEADER, Speed

from bsg_data.tables import format_text

FOLDER = Path(__file__).parent
# Set before the libraries start: many threads wait for one another, which hides our own cost.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
READING = (
    "Both times of a row come from the same run and the same work; they are seconds of processor, "
    "unless a row says otherwise. With target “≥”, ours must be at least that many times as fast. "
    "With “≤”, ours may take at most that many times as long, or at most that time."
)
TABLES = {
    "use": ("Beside what you would use instead", READING),
    "growth": ("As the data grow", "The same work with more buildings, or among more rooms."),
    "bound": ("Appendix: bounds", "A part of the work, run alone."),
}


def list_benchmarks() -> list[str]:
    """Return the names of the benchmarks: all files of this folder but this and `timing.py`."""
    return sorted({path.stem for path in FOLDER.glob("*.py")} - {"speed", "timing"})


def measure(name: str, hm3d: Path | None) -> tuple[Speed, ...]:
    """Return what one benchmark measures."""
    return tuple(importlib.import_module(name).measure(hm3d))


def main(argv: Sequence[str] | None = None) -> None:
    """Run the benchmarks, print the rows, and write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hm3d", type=Path, help="folder with annotations of HM3D")
    parser.add_argument("--out", type=Path, help="JSON of figures")
    parser.add_argument("--only", nargs="+", choices=list_benchmarks(), default=list_benchmarks())
    options = parser.parse_args(argv)
    os.environ.update(ONE_THREAD)
    speeds: list[Speed] = []
    for name in options.only:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            found = pool.submit(measure, name, options.hm3d).result()
        speeds += found
        print(format_text([one.cells() for one in found], header=HEADER), flush=True)
    print(f"{sum(one.is_met for one in speeds)} of {len(speeds)} targets are met.")
    if options.out:
        tables = [
            ResultsTable(title, HEADER, [o.cells() for o in speeds if o.kind == kind], reading)
            for kind, (title, reading) in TABLES.items()
        ]
        write_figures(options.out, "speed", tables, argv=argv or sys.argv)


if __name__ == "__main__":
    main()
