"""Measure each model of a leaderboard under every kind of mask.

    python scripts/measure/masks.py --leaderboard leaderboard --out docs/results/masks.md

A row is a model with the mask that it was trained on: NAME@MASK. The page shows three things: the
likelihood under each mask, the calibration of half-seen, glimpsed and unvisited rooms, and whether
beliefs improve as a robot searches room by room.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from fold_models import (
    list_models,
    measure_masks,
    open_dataset,
    open_folds,
)
from results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    is_told_apart,
    write_page,
)
from searched_rooms import STARTS, STOPS, Start, measure_searched_folds
from tallies import VIEWS, tally_all, tally_likelihood, tally_views

from bsg_models.evaluation.bootstrap import Bootstrap, bootstrap

TESTED = ("uniform", "rooms", "frontier", "explore", "search")
BEGUN: dict[Start, str] = {
    "nothing": "nothing was seen",
    "half": "half of every room was seen",
}


def tabulate_likelihood(found: dict[str, dict[str, Bootstrap]]) -> ResultsTable:
    """Return the NLL of every model under every mask; bold: not distinguishable from the best."""
    rows = []
    best = {mask: find_best(found, mask) for mask in TESTED}
    for name, by_mask in found.items():
        cells = []
        for mask, one in by_mask.items():
            cell = f"{one.point['nll']:.4f}"
            apart = is_told_apart(one.difference(found[best[mask]][mask], "nll"))
            cells.append(cell if apart else f"**{cell}**")
        rows.append((f"`{name}`", *cells, f"{find_worst(found, name)[1]:+.4f}"))
    reading = (
        "Hidden NLL over the classes of all rooms, mean over the folds; less is better. A row is a "
        "model and the mask it was trained on. A column is the mask of the test buildings. Bold "
        "marks the best of a column, and every model whose paired 95 % interval over buildings "
        "does not separate it from the best. “Largest gap” is the distance to the best of a "
        "column, in the column where that distance is largest."
    )
    header = ("model@training mask", *TESTED, "largest gap")
    return ResultsTable("NLL by training mask and test mask", header, tuple(rows), reading)


def find_best(found: dict[str, dict[str, Bootstrap]], mask: str) -> str:
    """Return the model with the lowest NLL under a mask."""
    return min(found, key=lambda name: found[name][mask].point["nll"])


def find_worst(found: dict[str, dict[str, Bootstrap]], name: str) -> tuple[str, float]:
    """Return the mask under which a model is furthest behind the best, and by how much."""
    behind = {
        mask: one.point["nll"] - found[find_best(found, mask)][mask].point["nll"]
        for mask, one in found[name].items()
    }
    worst = max(behind, key=lambda mask: behind[mask])
    return worst, behind[worst]


def tabulate_views(found: dict[str, dict[str, Bootstrap]]) -> ResultsTable:
    """Return predicted minus true presence, and NLL, for the three views of a room."""
    names = [f"{what}/{view}" for view in VIEWS for what in ("gap", "nll")]
    rows = [
        (
            f"`{name}`",
            *(
                format_estimate(by_mask["explore"].estimate(one), signed=one.startswith("gap"))
                for one in names
            ),
        )
        for name, by_mask in found.items()
    ]
    heads = [f"{view}: {what}" for view in VIEWS for what in ("predicted − true", "NLL")]
    reading = (
        "Predicted minus true presence, and NLL, under `explore` masks. Both are means over the "
        "classes of the rooms of a view. 0 is calibrated; above 0, the model predicts too much. "
        "[Evaluation](../evaluation.md) defines the views."
    )
    header = ("model@training mask", *heads)
    return ResultsTable("Calibration and NLL by view of the room", header, tuple(rows), reading)


def tabulate_searched(gains: dict[Start, dict[str, Bootstrap]]) -> list[ResultsTable]:
    """Return how much the likelihood of the unsearched rooms improves, a table a start."""
    tables: list[ResultsTable] = []
    for start, by_name in gains.items():
        rows = [
            (f"`{name}`", *(format_estimate(g.estimate(s), digits=2, signed=True) for s in STOPS))
            for name, g in by_name.items()
        ]
        reading = (
            f"As above, but at the start {BEGUN[start]}."
            if tables
            else "Gain of log-likelihood in the rooms not yet searched, in nats per room. A column "
            f"is the part of the rooms that was searched. At the start, {BEGUN[start]}. More is "
            "better; below 0, searching made the belief worse."
        )
        title = f"Gain by searching rooms, {start} seen at the start"
        header = ("model@training mask", *STOPS)
        tables.append(ResultsTable(title, header, tuple(rows), reading))
    return tables


def conclude(found: dict[str, dict[str, Bootstrap]]) -> tuple[str, ...]:
    """Return the model whose largest gap to the best is smallest, and the best of each mask."""
    steady = min(found, key=lambda name: find_worst(found, name)[1])
    mask, behind = find_worst(found, steady)
    wins = [mask for mask in TESTED if find_best(found, mask) == steady]
    if not behind:
        masks = ", ".join(f"`{one}`" for one in TESTED)
        return (f"`{steady}` has the lowest NLL under all {len(TESTED)} masks: {masks}.",)
    best = ", ".join(f"`{one}`: `{find_best(found, one)}`" for one in TESTED)
    return (
        f"Under every mask, the NLL of `{steady}` is at most {behind:.4f} above that of the best "
        f"model (most under `{mask}`). It is the best under {len(wins)} of {len(TESTED)} masks. "
        f"The best by mask: {best}.",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--models", nargs="*", help="NAME@MASK; default: all")
    parser.add_argument("--draws", type=int, default=5, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    parser.add_argument(
        "--orders",
        type=int,
        default=6,
        help="random orders in which the rooms of a building are searched",
    )
    options = parser.parse_args(argv)
    board = options.leaderboard
    found: dict[str, dict[str, Bootstrap]] = {}
    gains: dict[Start, dict[str, Bootstrap]] = {start: {} for start in STARTS}
    for name in options.models or list_models(board):
        found[name] = measure_masks(
            board,
            name,
            tally_all(tally_likelihood, tally_views),
            masks=TESTED,
            draws=options.draws,
            resamples=options.resamples,
        )
        for start, by_name in gains.items():
            means = measure_searched_folds(
                open_folds(board, name), start=start, orders=options.orders
            )
            by_name[name] = bootstrap(means, resamples=options.resamples)
        print(f"measured {name}", flush=True)
    data = open_dataset(board, next(iter(found)))
    page = ResultsPage(
        "One model for every kind of mask",
        conclude(found),
        (tabulate_likelihood(found), tabulate_views(found), *tabulate_searched(gains)),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
