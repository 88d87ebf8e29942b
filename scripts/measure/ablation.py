"""Measure what each part of a model is worth, by variants with one change each.

    bsg-leaderboard --data hm3d --out leaderboard --models universal,no-tilt.toml,no-area.toml
    python scripts/measure/ablation.py --leaderboard leaderboard --out docs/results/ablation.md

A variant is any model of the leaderboard: a TOML file with one change, or a name of the zoo. All
are trained on the same folds. The difference from the base is paired by building.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from fold_models import list_models, measure_masks, open_dataset
from results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    is_told_apart,
    write_page,
)
from tallies import tally_likelihood

from bsg_models.evaluation.bootstrap import Bootstrap

TESTED = ("uniform", "rooms", "frontier", "explore", "search")


def tabulate(found: dict[str, dict[str, Bootstrap]], base: str) -> ResultsTable:
    """Return the NLL of the base and the difference of each variant, a column a mask."""
    rows = [(f"`{base}`", *(f"{one.point['nll']:.4f}" for one in found[base].values()))]
    for name, by_mask in found.items():
        if name != base:
            gaps = [by_mask[mask].difference(found[base][mask], "nll") for mask in TESTED]
            rows.append((f"`{name}`", *(format_estimate(gap, signed=True) for gap in gaps)))
    reading = (
        "The first row is the hidden NLL of the base over the classes of all rooms. The other rows "
        "are paired differences from it, with their 95 % intervals over buildings. Above 0 is "
        "worse. [Results](README.md#model-names) explains the names."
    )
    return ResultsTable(
        "Difference from the base, by mask", ("variant", *TESTED), tuple(rows), reading
    )


def conclude(found: dict[str, dict[str, Bootstrap]], base: str) -> tuple[str, ...]:
    """Return a sentence for the variants that are better and worse under the same masks."""
    alike: dict[str, list[str]] = {}
    for name in found:
        if name == base:
            continue
        gaps = {m: found[name][m].difference(found[base][m], "nll") for m in TESTED}
        worse = [m for m, gap in gaps.items() if is_told_apart(gap) and gap.value > 0]
        better = [m for m, gap in gaps.items() if is_told_apart(gap) and gap.value < 0]
        parts = [
            f"{how} under {_list_masks(some)}"
            for how, some in (("worse", worse), ("better", better))
            if some
        ]
        said = " and ".join(parts) or "not distinguishable under any mask"
        alike.setdefault(said, []).append(f"`{name}`")
    sentences = [
        f"- {said[0].upper()}{said[1:]}: {', '.join(names)}." for said, names in alike.items()
    ]
    return ("\n".join([f"Compared with `{base}`, by hidden NLL:", "", *sentences]),)


def _list_masks(masks: Sequence[str]) -> str:
    """Return masks as words of a sentence."""
    if len(masks) == len(TESTED):
        return f"all {len(TESTED)} masks"
    return ", ".join(f"`{mask}`" for mask in masks)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--base", default="universal@mixed", help="NAME@MASK to compare with")
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
        "What each part of the model is worth",
        conclude(found, options.base),
        (tabulate(found, options.base),),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
