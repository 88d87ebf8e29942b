"""Write docs/results/reliability.md from the tally of the fault tests.

    python scripts/faults/report.py --tally build/faults.jsonl --out docs/results/reliability.md

`make faults` runs the tests, the fuzzers, the mutants, and then this script.
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

MUTANTS = "mutants"  # what `scripts/faults/mutants.py` calls its trials; they should not survive


class Trial(TypedDict):
    """One line of the tally; tests/faults/tally.py describes the fields."""

    test: str
    command: str
    tried: int
    survived: int
    misses: list[str]


def read_tally(path: Path) -> list[Trial]:
    """Return the trials: one for each test and command, tests in the order of the file.

    Raises:
        SystemExit: if a line is not a trial.
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
            sys.exit(
                f"{path}, line {number}: expected a trial, found {error!r}; run `make faults` again"
            )
    tests = list(dict.fromkeys(test for test, _ in found))
    return sorted(found.values(), key=lambda trial: (tests.index(trial["test"]), trial["command"]))


def conclude(trials: Sequence[Trial], mutants: Sequence[Trial]) -> tuple[str, ...]:
    """Return the sentences that say how many tries survived, and how many mutants did not."""
    tried, survived = add_up(trials)
    sentences = [f"{survived:,} of {tried:,} tries survived."]
    if mutants:
        tried, killed = add_up(mutants)
        sentences.append(f"The tests noticed {killed:,} of {tried:,} changes of the code.")
    return (" ".join(sentences),)


def add_up(trials: Iterable[Trial]) -> tuple[int, int]:
    """Return how many were tried and how many survived."""
    counts = [(trial["tried"], trial["survived"]) for trial in trials]
    return sum(tried for tried, _ in counts), sum(survived for _, survived in counts)


def tabulate_tests(trials: Iterable[Trial]) -> ResultsTable:
    """Return the summary: one row for each test."""
    tests: dict[str, list[Trial]] = {}
    for trial in trials:
        tests.setdefault(trial["test"], []).append(trial)
    rows = tuple(
        (test, str(len(found)), *(f"{count:,}" for count in add_up(found)))
        for test, found in tests.items()
    )
    reading = (
        "[Reliability](../reliability.md) says what each test does and when a try counts as "
        "survived."
    )
    header = "test", "commands or readers", "tried", "survived"
    return ResultsTable("Tries by test", header, rows, reading)


def tabulate_mutants(mutants: Iterable[Trial]) -> ResultsTable:
    """Return the table of mutants: one row for each room of code."""
    rows = tuple(
        (room["command"], f"{room['tried']:,}", f"{room['survived']:,}") for room in mutants
    )
    reading = (
        "A mutant is one changed place of the code that decides. It is killed if a test fails. "
        "`scripts/faults/mutants.py` draws a sample of each room."
    )
    return ResultsTable("Mutants", ("code", "tried", "killed"), rows, reading)


def tabulate_commands(trials: Iterable[Trial]) -> ResultsTable:
    """Return the long table: one row for each test and command."""
    rows = tuple(
        (trial["test"], trial["command"], f"{trial['tried']:,}", f"{trial['survived']:,}")
        for trial in trials
    )
    header = "test", "command or reader", "tried", "survived"
    return ResultsTable("Tries by test and command", header, rows)


def list_misses(trials: Iterable[Trial]) -> tuple[str, ...]:
    """Return the list of tries that did not survive, or the sentence that all did."""
    misses = [
        f"- {trial['test']}, {trial['command']}: {miss}"
        for trial in trials
        for miss in trial["misses"]
    ]
    if not misses:
        return ("There are no misses.",)
    return ("These are the misses:\n\n" + "\n".join(misses),)


def main(argv: Sequence[str] | None = None) -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tally", type=Path, required=True, help="file that the tests wrote")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--note", help="sentence about the runs that the tally is of")
    options = parser.parse_args(argv)
    found = [trial for trial in read_tally(options.tally) if trial["tried"]]
    mutants = [trial for trial in found if trial["test"] == MUTANTS]
    trials = [trial for trial in found if trial["test"] != MUTANTS]
    made = describe_run([__file__], date=date.today().isoformat())
    made = replace(made, command="make faults", machine=describe_machine())
    said = (*conclude(trials, mutants), *list_misses(found), *filter(None, [options.note]))
    tables = [tabulate_tests(trials), tabulate_commands(trials)]
    if mutants:
        tables.insert(1, tabulate_mutants(mutants))
    page = ResultsPage("Reliability", said, tuple(tables), made)
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
