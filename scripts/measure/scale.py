"""Measure what every command takes a building, from a few buildings to a hundred thousand.

    python scripts/measure/scale.py --work scale --out docs/results/scale.md

Buildings are synthetic. A command runs alone, in a process of its own with one thread, once for
every number of buildings; its processor time and the most memory that it held are kept in
`measured.jsonl` of the working folder, so that a measurement that was stopped goes on. What a
command takes whatever the data, above all to import its libraries, is that of the smallest number
of buildings, and is subtracted from the others.
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
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

from bsg_data.dataset.manifest import encode_manifest, read_manifest
from bsg_models.studies.results_page import (
    ResultsPage,
    ResultsTable,
    describe_machine,
    describe_run,
    write_page,
)

SIZES = (30, 1_000, 10_000, 100_000)
MEASURED = "measured.jsonl"
MEMORY = 1.5e9  # bytes that each command may hold
GROWTH = 1.15  # what a building may cost of many, against one of few
# A small process starts each command, because what a process holds counts for those it starts, too.
LAUNCH = """
import json, resource, subprocess, sys
status = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([status, used.ru_utime + used.ru_stime, used.ru_maxrss * 1024]))
"""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
MANY = 1_000_000  # buildings, of which the plan speaks
CORES = 64
PRICE = 0.05  # dollars of a core for an hour, about what clouds ask
PARALLEL = ("build", "pairs", "one epoch of universal")  # commands that use more than one core
TOLD = 0.5  # milliseconds a building that are told apart from what a command takes to start
TESTED = 0.1  # of the buildings, which `evaluate` reads

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
    """What one command took.

    Attributes:
        command: its name in `COMMANDS`.
        size: number of buildings in the dataset.
        cpu_s: seconds of all processors.
        wall_s: seconds that went by.
        peak_bytes: most memory that its largest process held.
    """

    command: str
    size: int
    cpu_s: float
    wall_s: float
    peak_bytes: int

    @property
    def handled(self) -> float:
        """Number of buildings that the command goes through."""
        return self.size * (TESTED if self.command == "evaluate" else 1)


def measure(name: str, size: int, work: Path) -> Cost:
    """Run a command once and return what it took.

    Raises:
        CalledProcessError: if it fails; what it says is on standard error.
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
    """Return what was measured in a working folder so far, by command and size."""
    path = work / MEASURED
    lines = path.read_text("utf-8").splitlines() if path.is_file() else []
    return {(cost.command, cost.size): cost for cost in (Cost(**json.loads(x)) for x in lines)}


def measure_all(work: Path, sizes: Sequence[int]) -> Iterator[Cost]:
    """Yield what every command takes of every size, measuring what was not yet."""
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
    """Return milliseconds of processor time a building, beyond what the fewest buildings take."""
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
        *(f"ms each of {size:,}" for size in others),
        f"{others[-1]:,} ÷ {others[0]:,}",
        *(f"MB of {size:,}" for size in sizes),
    )
    reading = (
        "Seconds and milliseconds are of processor time. Milliseconds are those of one building "
        f"more: what {sizes[0]} buildings take is subtracted. `evaluate` goes through the test "
        "split, a tenth of the buildings, and its milliseconds are of one of those. MB are the "
        "most that the process held at any time. – was not measured."
    )
    return ResultsTable("", header, tuple(rows), reading)


def conclude(costs: Iterable[Cost]) -> tuple[str, ...]:
    """Return which commands keep within the memory, and whose cost a building does not grow."""
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
        f"Of {sizes[-1]:,} buildings, {len(known) - len(large)} of {len(known)} commands "
        f"stay under {MEMORY / 1e9:g} GB" + (f"; {', '.join(large)} do not." if large else "."),
        f"From {sizes[1]:,} to {sizes[-1]:,} buildings, {told - len(growing)} of "
        f"{told} cost at most {GROWTH - 1:.0%} more a building"
        + (f"; more: {', '.join(growing)}." if growing else ".")
        + (f" Too quick to be told at {sizes[1]:,}: {', '.join(quick)}." if quick else ""),
        *([f"Not measured with {sizes[-1]:,}: {', '.join(missing)}."] if missing else []),
        f"Measured on {describe_machine()}, one process a command.",
    )


def plan(costs: Iterable[Cost]) -> ResultsTable:
    """Return what a million buildings would take, each as at the largest size."""
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
        "Not measured: the cost of a building in the largest dataset that was, times a million. "
        f"Dollars are at {PRICE} for a core and an hour. GB are as if memory went on growing as it "
        f"does from {sizes[0]} buildings to that dataset."
    )
    return ResultsTable(f"{MANY:,} buildings, from these slopes", header, tuple(rows), reading)


def weigh(work: Path, sizes: Sequence[int]) -> ResultsTable:
    """Return the bytes on disk a building, by what they are."""
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
    return ResultsTable("Disk, a building", header, tuple(rows))


def show_commands() -> ResultsTable:
    """Return the commands of the rows as a reader would type them."""
    places = {"buildings": "buildings", "dataset": "dataset", "runs": "runs", "size": "N"}
    rows = [(name, f"`{words.format(**places)}`") for name, words in COMMANDS.items()]
    return ResultsTable("Commands", ("row", "command"), tuple(rows))


def main() -> None:
    """Measure what is missing, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--work", type=Path, required=True, help="folder of data and measurements")
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES), help="of buildings")
    parser.add_argument("--out", type=Path, help="the page; without it nothing is written")
    parser.add_argument("--known", action="store_true", help="measure nothing more")
    options = parser.parse_args()
    sizes = sorted(set(options.sizes))
    if sizes[0] < 1 or (options.out is not None and len(sizes) < 3):
        parser.error("--sizes: a page needs three numbers of buildings or more")
    costs = list(
        (cost for cost in read_costs(options.work).values() if cost.size in sizes)
        if options.known
        else measure_all(options.work, sizes)
    )
    if options.out is not None:
        page = ResultsPage(
            "What a building costs, from a few to a hundred thousand",
            conclude(costs),
            (tabulate(costs), weigh(options.work, sizes), plan(costs), show_commands()),
            describe_run(sys.argv, date=date.today().isoformat()),
        )
        write_page(page, options.out)


if __name__ == "__main__":
    main()
