"""Run every speed benchmark beside its comparison, and write the page.

    python scripts/bench/speed.py --out docs/results/speed.md
    python scripts/bench/speed.py --only draws mesh     # prints the table of two

A benchmark is a file of this folder whose `measure()` yields `Speed` records. Each runs in its own
process, with one thread per library, so that none disturbs another. A benchmark also runs alone:
`python scripts/bench/draws.py`. `make bench` writes the page.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import date
from pathlib import Path

from timing import HEADER, Speed, print_speeds

from bsg_models.studies.results_page import (
    ResultsPage,
    ResultsTable,
    describe_machine,
    describe_run,
    write_page,
)

FOLDER = Path(__file__).parent
BENCHMARKS = ("training", "belief", "draws", "mesh", "search", "opening", "build")
# Set before the libraries start: many threads wait for one another, which hides our own cost.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_alone(name: str) -> tuple[Speed, ...]:
    """Return what one benchmark measures, in its own process."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, name).result()


def measure(name: str) -> tuple[Speed, ...]:
    """Return what one benchmark measures; nothing if it has no `measure()`."""
    module = importlib.import_module(name)
    return tuple(module.measure()) if hasattr(module, "measure") else ()


def run_all(names: Sequence[str]) -> dict[str, tuple[Speed, ...]]:
    """Return what each benchmark measures; nothing if its file is missing."""
    found: dict[str, tuple[Speed, ...]] = {}
    for name in names:
        began = time.perf_counter()
        found[name] = run_alone(name) if (FOLDER / f"{name}.py").is_file() else ()
        seconds = time.perf_counter() - began
        print(f"{name}: {len(found[name])} rows in {seconds:.0f} s", file=sys.stderr)
    return found


def conclude(found: dict[str, tuple[Speed, ...]]) -> tuple[str, ...]:
    """Return how many targets are met, and which benchmarks are missing."""
    every = [speed for speeds in found.values() for speed in speeds]
    met = [speed.what for speed in every if speed.is_met]
    sentences = [f"{len(met)} of {len(every)} targets are met."]
    missed = [speed.what for speed in every if not speed.is_met]
    if met and missed:
        how, few = min(("Met", met), ("Missed", missed), key=lambda one: len(one[1]))
        sentences.append(f"{how}: {'; '.join(dict.fromkeys(few))}.")
    missing = [name for name, speeds in found.items() if not speeds]
    if missing:
        sentences.append(f"Not measured: {', '.join(missing)}.")
    return tuple(sentences)


def tabulate(found: dict[str, tuple[Speed, ...]]) -> ResultsTable:
    """Return the table of the page."""
    rows = [
        (*speed.cells(), f"`scripts/bench/{name}.py`")
        for name, speeds in found.items()
        for speed in speeds
    ]
    reading = (
        "Both times of a row come from the same run and the same work. With target “≥”, ours must "
        "be at least that many times as fast. With “≤”, ours may take at most that many times as "
        "long, or at most that time."
    )
    return ResultsTable("Times and targets", (*HEADER, "made by"), tuple(rows), reading)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the benchmarks, print the table, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="page to write")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKS, default=BENCHMARKS)
    options = parser.parse_args(argv)
    os.environ.update(ONE_THREAD)
    found = run_all(options.only)
    print_speeds(speed for speeds in found.values() for speed in speeds)
    if options.out is not None:
        made = describe_run([__file__, *(argv or sys.argv[1:])], date=date.today().isoformat())
        made = replace(made, machine=describe_machine())
        write_page(ResultsPage("Speed", conclude(found), (tabulate(found),), made), options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
