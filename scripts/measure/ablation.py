"""Measure what each part of a model is worth: variants of it, one change each, on the same folds.

    bsg-leaderboard --data hm3d --out leaderboard --models universal,no-tilt.toml,no-area.toml
    python scripts/measure/ablation.py --leaderboard leaderboard --out docs/results/ablation.md

A variant is any model of the leaderboard: a TOML file with one change, or a name of the zoo. The
difference from the base is paired, building by building.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.tallies import tally_likelihood
from bsg_models.studies.fold_models import list_models, measure_masks, open_dataset
from bsg_models.studies.results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    is_told_apart,
    write_page,
)

TESTED = ("uniform", "rooms", "frontier", "explore", "search")


def tabulate(found: dict[str, dict[str, Bootstrap]], base: str) -> ResultsTable:
    """Return what a variant loses under each mask."""
    rows = [(f"`{base}`", *(f"{one.point['nll']:.4f}" for one in found[base].values()))]
    for name, by_mask in found.items():
        if name != base:
            gaps = [by_mask[mask].difference(found[base][mask], "nll") for mask in TESTED]
            rows.append((f"`{name}`", *(format_estimate(gap, signed=True) for gap in gaps)))
    reading = (
        "First the hidden NLL of the base over the classes of all rooms, then of each variant the "
        "paired difference with its 95 % interval over buildings; more than 0 is worse."
    )
    return ResultsTable("What each change costs", ("variant", *TESTED), tuple(rows), reading)


def conclude(found: dict[str, dict[str, Bootstrap]], base: str) -> tuple[str, ...]:
    """Return a sentence a variant: where it is worse, and where better, than the base."""
    sentences = []
    for name in found:
        if name == base:
            continue
        gaps = {m: found[name][m].difference(found[base][m], "nll") for m in TESTED}
        worse = [m for m, gap in gaps.items() if is_told_apart(gap) and gap.value > 0]
        better = [m for m, gap in gaps.items() if is_told_apart(gap) and gap.value < 0]
        parts = [
            f"{how} under {', '.join(f'`{m}`' for m in some)}"
            for how, some in (("worse", worse), ("better", better))
            if some
        ]
        said = " and ".join(parts) or "not distinguishable under any mask"
        sentences.append(f"- `{name}` is {said}.")
    return (f"Beside `{base}`:", "\n".join(sentences))


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--base", default="universal@mixed", help="NAME@MASK of the whole model")
    parser.add_argument("--variants", nargs="*", help="NAME@MASK; default: all of the base's mask")
    parser.add_argument("--draws", type=int, default=5, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    options = parser.parse_args(argv)
    variants = options.variants or list_models(
        options.leaderboard, [options.base.partition("@")[2]]
    )
    found = {
        name: measure_masks(
            options.leaderboard,
            name,
            tally_likelihood,
            masks=TESTED,
            draws=options.draws,
            resamples=options.resamples,
        )
        for name in dict.fromkeys((options.base, *variants))
    }
    data = open_dataset(options.leaderboard, options.base)
    page = ResultsPage(
        "What each part is worth",
        conclude(found, options.base),
        (tabulate(found, options.base),),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
