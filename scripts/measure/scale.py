"""Measure the time and memory of every command, from 30 buildings to a hundred thousand.

    python scripts/measure/scale.py --work scale --out docs/results/scale.md

Buildings are synthetic. Each command runs alone, in its own process with one thread, once for every
number of buildings. `measured.jsonl` of the working folder keeps its processor time and its peak
memory, so a stopped measurement continues. The smallest number of buildings gives the fixed cost,
mostly imports; the script subtracts it from the others.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path

from results_page import (
    ResultsPage,
    ResultsTable,
    describe_machine,
    describe_run,
    write_page,
)

from bsg_data.dataset.manifest import encode_manifest, read_manifest

SIZES = (30, 1_000, 10_000, 100_000)
MEASURED = "measured.jsonl"
MEMORY = 1.5e9  # largest number of bytes that a command may hold
GROWTH = 1.15  # largest growth of the cost per building, from few buildings to many
# A small process starts each command: memory of a process counts for the processes it starts.
LAUNCH = """
import json, resource, subprocess, sys
status = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([status, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024]))
"""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
MANY = 1_000_000  # buildings of the estimate
CORES = 64
PRICE = 0.05  # dollars per core hour, a usual cloud price
PARALLEL = ("build", "pairs", "one epoch of universal")  # commands that use more than one core
TOLD = 0.5  # fewest milliseconds a building that differ clearly from the start of a command
TESTED = 0.1  # share of the buildings that `evaluate` reads

COMMANDS = {
    "synth": "bsg-data synth --out {buildings} --scenes {size} --seed 11 --force",
    "build": "bsg-data build --hm3d {buildings} --out {dataset} --workers 1 --force",
    "split": "bsg-data split {dataset} --ratios 0.8 0.1 0.1 --force",
    "pairs": "bsg-data pairs {dataset} --draws 1 --workers 1 --force",
    "check": "bsg-data check {dataset}",
    "info": "bsg-data info {dataset}",
    "coverage": "bsg-data map coverage {dataset}",
    "one epoch of universal": (
        "bsg-train --config universal --data {dataset} --out {runs}/universal "
        "--set training.epochs=1 --force"
    ),
    "mixture": "bsg-train --config mixture --data {dataset} --out {runs}/mixture --force",
    "evaluate": "bsg-evaluate {runs}/mixture --data {dataset} --out {runs}/evaluation --force",
}


@dataclass(frozen=True, slots=True)
class Cost:
    """The cost of one command.

    Attributes:
        command: its name in `COMMANDS`.
        size: number of buildings in the dataset.
        cpu_s: processor seconds, all cores.
        wall_s: seconds by the clock.
        peak_bytes: peak memory of its largest process.
    """

    command: str
    size: int
    cpu_s: float
    wall_s: float
    peak_bytes: int

    @property
    def handled(self) -> float:
        """Number of buildings that the command reads."""
        return self.size * (TESTED if self.command == "evaluate" else 1)


def measure(name: str, size: int, work: Path) -> Cost:
    """Run a command once and return its cost.

    Raises:
        CalledProcessError: if it fails; its message is on standard error.
    """
    places = {
        "buildings": work / str(size) / "buildings",
        "dataset": work / str(size) / "dataset",
        "runs": work / str(size) / "runs",
    }
    words = [word.format(size=size, **places) for word in COMMANDS[name].split()]
    words[0] = str(Path(sys.executable).with_name(words[0]))
    began = time.perf_counter()
    launched = subprocess.run(
        [sys.executable, "-c", LAUNCH, *words],
        env={**os.environ, **ONE_THREAD},
        stdout=subprocess.PIPE,
        check=True,
    )
    status, cpu_s, peak_bytes = json.loads(launched.stdout)
    if status:
        raise subprocess.CalledProcessError(status, words)
    return Cost(name, size, cpu_s, time.perf_counter() - began, peak_bytes)


def read_costs(work: Path) -> dict[tuple[str, int], Cost]:
    """Return the costs measured in a working folder so far, by command and size."""
    path = work / MEASURED
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    return {(cost.command, cost.size): cost for cost in (Cost(**json.loads(x)) for x in lines)}


def measure_all(work: Path, sizes: Sequence[int]) -> Iterator[Cost]:
    """Yield the cost of every command at every size; measure those that are missing."""
    known = read_costs(work)
    for size in sizes:
        (work / str(size)).mkdir(parents=True, exist_ok=True)
        for name in COMMANDS:
            if (name, size) not in known:
                cost = measure(name, size, work)
                with (work / MEASURED).open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(cost)) + "\n")
                print(f"{name} of {size:,}: {cost.cpu_s:.1f} s", file=sys.stderr)
                known[name, size] = cost
            yield known[name, size]


def cost_a_building(cost: Cost, least: Cost) -> float:
    """Return processor milliseconds a building, without the cost of the fewest buildings."""
    return 1000 * (cost.cpu_s - least.cpu_s) / (cost.handled - least.handled)


def tabulate(costs: Iterable[Cost]) -> ResultsTable:
    """Return the table of the page: a row a command."""
    found = {(cost.command, cost.size): cost for cost in costs}
    sizes = sorted({size for _, size in found})
    rows = []
    for name in COMMANDS:
        least = found[name, sizes[0]]
        each = [
            cost_a_building(found[name, size], least) if (name, size) in found else math.nan
            for size in sizes[1:]
        ]
        peaks = [found[name, size].peak_bytes if (name, size) in found else None for size in sizes]
        rows.append(
            (
                name,
                f"{least.cpu_s:.1f}",
                *("–" if math.isnan(cost) else f"{cost:.2f}" for cost in each),
                "–" if math.isnan(each[-1]) or each[0] < TOLD else f"{each[-1] / each[0]:.2f}",
                *("–" if peak is None else f"{peak / 1e6:,.0f}" for peak in peaks),
            )
        )
    others = sizes[1:]
    header = (
        "command",
        f"{sizes[0]} buildings, s",
        *(f"ms per building of {size:,}" for size in others),
        f"{others[-1]:,} ÷ {others[0]:,}",
        *(f"MB with {size:,}" for size in sizes),
    )
    reading = (
        "Each command ran alone in its own process. Seconds and milliseconds are processor time. "
        f"Milliseconds are the cost of one more building: the time of {sizes[0]} buildings is "
        "subtracted. The command `evaluate` reads the test split, a tenth of the buildings; its "
        "milliseconds are per building of that split. MB is the peak memory of the process. – "
        "means not measured, or too quick to compare."
    )
    return ResultsTable("Time and memory", header, tuple(rows), reading)


def conclude(costs: Iterable[Cost]) -> tuple[str, ...]:
    """Return how many commands stay within the memory limit and the limit of growth."""
    found = {(cost.command, cost.size): cost for cost in costs}
    sizes = sorted({size for _, size in found})
    known = [name for name in COMMANDS if (name, sizes[-1]) in found]
    large = [name for name in known if found[name, sizes[-1]].peak_bytes > MEMORY]
    growing, quick = [], []
    for name in known:
        least = found[name, sizes[0]]
        few, many = (cost_a_building(found[name, size], least) for size in (sizes[1], sizes[-1]))
        if few < TOLD:
            quick.append(name)
        elif many > GROWTH * few:
            growing.append(f"{name} ({many / few:.2f} times)")
    told = len(known) - len(quick)
    missing = [name for name in COMMANDS if name not in known]
    return (
        f"With {sizes[-1]:,} buildings, {len(known) - len(large)} of {len(known)} commands stay "
        f"under {MEMORY / 1e9:g} GB of memory" + (f"; more: {', '.join(large)}." if large else "."),
        f"From {sizes[1]:,} to {sizes[-1]:,} buildings, the cost per building grows by at most "
        f"{GROWTH - 1:.0%} for {told - len(growing)} of {told} commands"
        + (f"; more: {', '.join(growing)}." if growing else ".")
        + (f" Too quick to compare at {sizes[1]:,}: {', '.join(quick)}." if quick else ""),
        *([f"Not measured with {sizes[-1]:,}: {', '.join(missing)}."] if missing else []),
    )


def plan(costs: Iterable[Cost]) -> ResultsTable:
    """Return the estimate for a million buildings, from the cost at the largest size."""
    found = {(cost.command, cost.size): cost for cost in costs}
    sizes = sorted({size for _, size in found})
    rows = []
    for name in COMMANDS:
        least = found[name, sizes[0]]
        most = next(found[name, size] for size in reversed(sizes) if (name, size) in found)
        tested = TESTED if name == "evaluate" else 1
        hours = MANY * tested * cost_a_building(most, least) / 3.6e6
        grown = (most.peak_bytes - least.peak_bytes) / (most.size - least.size)
        rows.append(
            (
                name,
                f"{hours:.1f}",
                f"{hours / CORES:.2f}" if name in PARALLEL else "one core",
                f"{hours * PRICE:.2f}",
                f"{(least.peak_bytes + MANY * grown) / 1e9:.1f}",
            )
        )
    header = ("command", "core hours", f"hours on {CORES} cores", "dollars", "GB")
    reading = (
        "This is an estimate: the cost per building in the largest measured dataset, times a "
        f"million. A core hour costs {PRICE} dollars. GB assumes that memory keeps growing as it "
        f"does from {sizes[0]} buildings to that dataset. “One core” means that the command uses "
        "one core only."
    )
    return ResultsTable(f"Estimate for {MANY:,} buildings", header, tuple(rows), reading)


def weigh(work: Path, sizes: Sequence[int]) -> ResultsTable:
    """Return the disk space a building, by kind of file."""
    rows = []
    for size in sizes:
        manifest = read_manifest(work / str(size) / "dataset")
        annotations = sum(
            path.stat().st_size for path in (work / str(size) / "buildings").rglob("*.txt")
        )
        pairs = sum(entry.bytes for entry in manifest.files_of("pairs"))
        tables = sum(entry.bytes for entry in manifest.files) - pairs
        listed = len(encode_manifest(manifest))
        cells = (f"{count / size / 1e3:.1f}" for count in (annotations, tables, pairs, listed))
        rows.append((f"{size:,}", *cells))
    header = ("buildings", "annotation, kB", "tables, kB", "pairs of one draw, kB", "manifest, kB")
    return ResultsTable("Disk space per building", header, tuple(rows))


def show_commands() -> ResultsTable:
    """Return the command of each row as a reader would type it."""
    places = {"buildings": "buildings", "dataset": "dataset", "runs": "runs", "size": "N"}
    rows = [(name, f"`{words.format(**places)}`") for name, words in COMMANDS.items()]
    return ResultsTable("Commands", ("row", "command"), tuple(rows))


def main() -> None:
    """Measure the missing costs and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--work", type=Path, required=True, help="folder for data and measurements")
    parser.add_argument(
        "--sizes", type=int, nargs="+", default=list(SIZES), help="numbers of buildings"
    )
    parser.add_argument("--out", type=Path, help="page to write; default: no page")
    parser.add_argument(
        "--known", action="store_true", help="write the page from earlier measurements"
    )
    options = parser.parse_args()
    sizes = sorted(set(options.sizes))
    if sizes[0] < 1 or (options.out is not None and len(sizes) < 3):
        parser.error("--sizes: expected at least 1 building, and three sizes or more for a page")
    costs = list(
        (cost for cost in read_costs(options.work).values() if cost.size in sizes)
        if options.known
        else measure_all(options.work, sizes)
    )
    if options.out is not None:
        page = ResultsPage(
            "Cost per building as datasets grow",
            conclude(costs),
            (tabulate(costs), weigh(options.work, sizes), plan(costs), show_commands()),
            replace(
                describe_run(sys.argv, date=date.today().isoformat()), machine=describe_machine()
            ),
        )
        write_page(page, options.out)


if __name__ == "__main__":
    main()
