"""Compare P(another one | a room shows exactly one) with the truth.

    python scripts/measure/fixtures.py --leaderboard leaderboard --out docs/results/fixtures.md

A kitchen that shows a refrigerator seldom hides a second one. A bedroom that shows a nightstand
often does. Masks are `uniform`; the mean is over all rooms that show exactly one of the class.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import date
from functools import partial
from pathlib import Path

import numpy as np
from fold_models import list_models, measure_masks, open_dataset
from results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    write_page,
)
from tallies import tally_second

from bsg_data.errors import DatasetError
from bsg_models.evaluation.bootstrap import Bootstrap, Estimate, estimate_value

SINGLE = (
    "refrigerator",
    "tv",
    "bathtub",
    "toilet",
    "dishwasher",
    "microwave",
    "stove",
)
PAIRS = ("nightstand", "pillow", "washing machine")  # this class includes dryers
MASK = "uniform"


def tabulate(found: dict[str, Bootstrap], classes: Sequence[str]) -> ResultsTable:
    """Return a row a class: the rooms, the truth, and what each model predicts, in per cent."""
    first = next(iter(found.values()))
    rows = []
    for name in classes:
        true = format_estimate(scale(first, f"true/{name}"), digits=0)
        said = [f"{100 * one.point[f'said/{name}']:.0f}" for one in found.values()]
        rows.append((name, str(first.nodes[f"true/{name}"]), true, *said))
    header = ("class", "rooms", "true", *(f"`{name}`" for name in found))
    reading = (
        "P(at least one more is hidden), in per cent. The mean is over all rooms and masks that "
        "show exactly one object of the class. The true share has a 95 % interval over buildings."
    )
    return ResultsTable("Probability of a second object", header, tuple(rows), reading)


def scale(one: Bootstrap, name: str) -> Estimate:
    """Return a share in per cent, with its interval."""
    return estimate_value(
        100 * one.point[name],
        100 * one.resampled[name],
        nodes=one.nodes[name],
        rule="percentile",  # never below 0
    )


def conclude(found: dict[str, Bootstrap], classes: Sequence[str]) -> tuple[str, ...]:
    """Return how far each model is from the truth: single fixtures, then pairs."""
    sentences = []
    for what, some in (("single fixtures", SINGLE), ("objects that come in pairs", PAIRS)):
        known = [name for name in some if name in classes]
        if known:
            far = {
                model: np.mean(
                    [abs(one.point[f"said/{c}"] - one.point[f"true/{c}"]) for c in known]
                )
                for model, one in found.items()
            }
            best, *others = sorted(far, key=lambda model: far[model])
            rest = ", ".join(f"`{model}` {100 * far[model]:.1f}" for model in others)
            sentences.append(
                f"For {what}, `{best}` is closest to the truth: its mean error over the classes is "
                f"{100 * far[best]:.1f} percentage points{f' ({rest})' if rest else ''}."
            )
    return tuple(sentences)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--models", nargs="*", help="NAME@MASK; default: those of all masks")
    parser.add_argument("--draws", type=int, default=5, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    options = parser.parse_args(argv)
    names = options.models or list_models(options.leaderboard)
    data = open_dataset(options.leaderboard, names[0])
    space = data.manifest.class_space.classes
    classes = {name: space.index(name) for name in (*SINGLE, *PAIRS) if name in space}
    if not classes:
        raise DatasetError(f"{data.path}: its class space has none of {', '.join(SINGLE)}")
    found = {
        name: measure_masks(
            options.leaderboard,
            name,
            partial(tally_second, classes=classes),
            masks=(MASK,),
            draws=options.draws,
            resamples=options.resamples,
            by_fold=False,
        )[MASK]
        for name in names
    }
    nodes = next(iter(found.values())).nodes
    shown = [name for name in classes if nodes[f"true/{name}"]]
    if not shown:
        raise DatasetError(f"{data.path}: no room shows exactly one of {', '.join(classes)}")
    page = ResultsPage(
        "Is there a second object of the class?",
        conclude(found, shown),
        (tabulate(found, shown),),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
