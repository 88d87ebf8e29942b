"""Measure each model of a leaderboard on every kind of view, whatever it was trained on.

    python scripts/measure/masks.py --leaderboard leaderboard --out docs/results/masks.md

Rows are models with the mask that they were trained on, NAME@MASK. The page has their likelihood
under each mask, what they say of half-seen, glimpsed and unvisited rooms beside what is true, and
whether their beliefs improve as a robot searches room by room.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from bsg_models.evaluation.bootstrap import Bootstrap, bootstrap
from bsg_models.evaluation.room_views import VIEWS
from bsg_models.evaluation.tallies import tally_all, tally_likelihood, tally_views
from bsg_models.studies.fold_models import (
    list_models,
    measure_masks,
    open_dataset,
    open_folds,
)
from bsg_models.studies.results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    is_told_apart,
    write_page,
)
from bsg_models.studies.searched_rooms import STARTS, STOPS, Start, measure_searched_folds

TESTED = ("uniform", "rooms", "frontier", "explore", "search")


def tabulate_likelihood(found: dict[str, dict[str, Bootstrap]]) -> ResultsTable:
    """Return the NLL of every model under every mask; in bold what cannot be told from the best."""
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
        "Hidden NLL over the classes of all rooms, mean over the folds; less is better. Columns "
        "are the masks of the test buildings. In bold the best of a column and what its paired "
        "95 % interval over buildings does not tell from it. The last column is how far a model is "
        "behind the best of a column where it is furthest behind."
    )
    header = ("trained as", *TESTED, "furthest behind")
    return ResultsTable("Likelihood by training mask and test mask", header, tuple(rows), reading)


def find_best(found: dict[str, dict[str, Bootstrap]], mask: str) -> str:
    """Return the model with the least NLL under a mask."""
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
    """Return what models say of the three views of a room, minus what is true."""
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
    heads = [f"{view}: {what}" for view in VIEWS for what in ("said − true", "NLL")]
    reading = (
        "Presence as said minus as true, mean over the classes of the rooms of each view, and "
        "their NLL; `explore` masks. 0 is calibrated, more than 0 promises too much."
    )
    return ResultsTable(
        "Rooms by how much was seen of them", ("trained as", *heads), tuple(rows), reading
    )


def tabulate_searched(gains: dict[Start, dict[str, Bootstrap]]) -> list[ResultsTable]:
    """Return how much less of a surprise the rooms that are left become."""
    tables = []
    for start, by_name in gains.items():
        rows = [
            (f"`{name}`", *(format_estimate(g.estimate(s), digits=2, signed=True) for s in STOPS))
            for name, g in by_name.items()
        ]
        reading = (
            f"Gain in nats a room about the rooms that were not searched, after part of the rooms "
            f"was; {start} was seen before. More is better, less than 0 is worse than not looking."
        )
        title = f"Do beliefs improve as rooms are searched? Begun with {start} seen"
        tables.append(ResultsTable(title, ("trained as", *STOPS), tuple(rows), reading))
    return tables


def conclude(found: dict[str, dict[str, Bootstrap]]) -> tuple[str, ...]:
    """Return which model is least behind on any kind of view."""
    steady = min(found, key=lambda name: find_worst(found, name)[1])
    mask, behind = find_worst(found, steady)
    wins = [mask for mask in TESTED if find_best(found, mask) == steady]
    first = (
        f"Whatever a robot has seen, `{steady}` is at most {behind:.4f} of NLL behind the best "
        f"model for it (under `{mask}`)."
        if behind
        else f"Whatever a robot has seen, `{steady}` is the best model for it."
    )
    of = ", ".join(f"`{mask}`: `{find_best(found, mask)}`" for mask in TESTED)
    return first, f"It is the best under {len(wins)} of {len(TESTED)} masks. The best are {of}."


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--models", nargs="*", help="NAME@MASK; default: all")
    parser.add_argument("--draws", type=int, default=5, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    parser.add_argument("--orders", type=int, default=6, help="of the rooms of a building")
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
        "One model for whatever a robot has seen",
        conclude(found),
        (tabulate_likelihood(found), tabulate_views(found), *tabulate_searched(gains)),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
