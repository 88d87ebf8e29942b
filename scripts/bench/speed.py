"""Run every benchmark of speed, each beside what it is compared with, and write the page.

    python scripts/bench/speed.py --out docs/results/speed.md
    python scripts/bench/speed.py --only draws mesh     # prints the table of some

A benchmark is a file of this folder whose `measure()` yields records of `Speed`. Each runs in a
process of its own, with one thread a library, so that none disturbs another, and runs alone, too:
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
# Before the libraries start: threads of many wait for one another, and say nothing of our code.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_alone(name: str) -> tuple[Speed, ...]:
    """Return what one benchmark measures, in a process of its own."""
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(measure, name).result()


def measure(name: str) -> tuple[Speed, ...]:
    """Return what one benchmark measures; nothing, if it has no `measure()`."""
    module = importlib.import_module(name)
    return tuple(module.measure()) if hasattr(module, "measure") else ()


def run_all(names: Sequence[str]) -> dict[str, tuple[Speed, ...]]:
    """Return what each benchmark measures, one after another; nothing for no file."""
    found: dict[str, tuple[Speed, ...]] = {}
    for name in names:
        began = time.perf_counter()
        found[name] = run_alone(name) if (FOLDER / f"{name}.py").is_file() else ()
        seconds = time.perf_counter() - began
        print(f"{name}: {len(found[name])} rows in {seconds:.0f} s", file=sys.stderr)
    return found


def conclude(found: dict[str, tuple[Speed, ...]]) -> tuple[str, ...]:
    """Return how many targets were met, and which benchmarks are missing."""
    every = [speed for speeds in found.values() for speed in speeds]
    sentences = [f"{sum(speed.is_met for speed in every)} of {len(every)} targets are met."]
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
        "Both times of a row are of the same run and of the same work. A target “≥” is how many "
        "times as fast ours is at least; “≤” how many times as long it takes at most, or how long."
    )
    return ResultsTable("Speed", (*HEADER, "made by"), tuple(rows), reading)


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
