"""Turn what the tests of faults noted into the page docs/results/reliability.md.

    python scripts/faults/report.py --tally build/faults.jsonl --out docs/results/reliability.md

`make faults` runs the tests, the fuzzers and the mutants, and this at the end.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TypedDict

from bsg_models.studies.results_page import (
    ResultsPage,
    ResultsTable,
    describe_machine,
    describe_run,
    write_page,
)


class Trial(TypedDict):
    """A line of the tally: see tests/faults/tally.py."""

    test: str
    command: str
    tried: int
    survived: int
    misses: list[str]


def read_tally(path: Path) -> list[Trial]:
    """Return the trials, those of one test and command as one, in the order of their first lines.

    Raises:
        SystemExit: if a line is no trial.
    """
    found: dict[tuple[str, str], Trial] = {}
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        try:
            trial = Trial(**json.loads(line))
            key = trial["test"], trial["command"]
            before = found.get(key, {**trial, "tried": 0, "survived": 0, "misses": []})
            found[key] = {
                "test": trial["test"],
                "command": trial["command"],
                "tried": before["tried"] + trial["tried"],
                "survived": before["survived"] + trial["survived"],
                "misses": [*before["misses"], *trial["misses"]],
            }
        except (ValueError, TypeError, KeyError) as error:
            sys.exit(f"{path}, line {number}: expected a trial, found {error!r}; run `make faults`")
    tests = list(dict.fromkeys(test for test, _ in found))
    return sorted(found.values(), key=lambda trial: (tests.index(trial["test"]), trial["command"]))


def conclude(trials: Sequence[Trial]) -> tuple[str, ...]:
    """Return how many tries survived: all of them, and those of each test."""
    tried = sum(trial["tried"] for trial in trials)
    survived = sum(trial["survived"] for trial in trials)
    return (f"{survived:,} of {tried:,} tries survived.",)


def tabulate(trials: Iterable[Trial]) -> ResultsTable:
    """Return the table of tests, commands, tries and survivors."""
    rows = tuple(
        (trial["test"], trial["command"], f"{trial['tried']:,}", f"{trial['survived']:,}")
        for trial in trials
    )
    reading = "docs/reliability.md says what each test does and what it takes to survive it."
    return ResultsTable("What was tried", ("test", "command", "tried", "survived"), rows, reading)


def list_misses(trials: Iterable[Trial]) -> tuple[str, ...]:
    """Return every miss as an item of a list; one item says that there is none."""
    misses = [
        f"- {trial['test']}, {trial['command']}: {miss}"
        for trial in trials
        for miss in trial["misses"]
    ]
    return ("Misses:\n\n" + "\n".join(misses),) if misses else ("There are no misses.",)


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tally", type=Path, required=True, help="what the tests noted")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    options = parser.parse_args(argv)
    trials = read_tally(options.tally)
    made = describe_run([__file__], date=date.today().isoformat())
    made = replace(made, command="make faults", machine=describe_machine())
    page = ResultsPage(
        "Reliability", (*conclude(trials), *list_misses(trials)), (tabulate(trials),), made
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
