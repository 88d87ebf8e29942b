"""Measure how much floor area and room label tell about unvisited rooms.

    python scripts/measure/room_size.py --leaderboard board --out docs/results/room_size.md

Every model is asked about the same unvisited rooms: with neither, with one, and with both. Rooms
without a known floor area (or label) are left out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from fold_models import (
    list_models,
    mask_of,
    measure_models,
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
from tallies import tally_surroundings

from bsg_data.errors import DatasetError
from bsg_models.evaluation.bootstrap import Bootstrap, bootstrap

EVIDENCE = {"floor_area": "floor area", "labels": "room label"}
OTHER = {"floor_area": "labels", "labels": "floor_area"}
WITHOUT = {  # what is told → what is withheld
    "nothing": ("floor_area", "labels"),
    "floor_area": ("labels",),
    "labels": ("floor_area",),
    "both": (),
}
MASK = "rooms"


def tabulate(found: dict[str, dict[str, Bootstrap]], evidence: str) -> ResultsTable:
    """Return the loss with and without one piece of evidence, a row a model."""
    rows = []
    for name, by_told in found.items():
        nothing, alone, both = (by_told[told] for told in ("nothing", evidence, "both"))
        gap = alone.difference(nothing, evidence)
        rows.append(
            (
                f"`{name}`",
                f"{nothing.point[evidence]:.4f}",
                f"{alone.point[evidence]:.4f}",
                format_estimate(gap, signed=True),
                f"{100 * gap.value / nothing.point[evidence]:+.1f} %",
                f"{both.point[evidence]:.4f}",
            )
        )
    number = next(iter(found.values()))["both"].nodes[evidence]
    what, other = EVIDENCE[evidence], EVIDENCE[OTHER[evidence]]
    reading = (
        f"Log-loss of presence, mean over {number:,} (room, class, mask) cells of unvisited rooms "
        f"with a known {what}. The difference compares the {what} alone with neither; the {other} "
        "is not told. It is paired, with its 95 % interval over buildings. Below 0, the "
        f"{what} helps."
    )
    header = ("model", "told neither", f"told the {what}", "difference", "relative", "told both")
    return ResultsTable(what.capitalize(), header, tuple(rows), reading)


def conclude(found: dict[str, dict[str, Bootstrap]], known: Sequence[str]) -> tuple[str, ...]:
    """Return which models improve with which evidence."""
    sentences = []
    for evidence in known:
        gains = {}
        for name, by_told in found.items():
            gap = by_told[evidence].difference(by_told["nothing"], evidence)
            if is_told_apart(gap) and gap.value < 0:
                gains[name] = -100 * gap.value / by_told["nothing"].point[evidence]
        by = ", ".join(f"`{name}` by {gain:.1f} %" for name, gain in gains.items())
        effect = f"lowers the log-loss of {by}" if by else "improves no model by more than chance"
        sentences.append(f"In unvisited rooms, the {EVIDENCE[evidence]} alone {effect}.")
    return tuple(sentences)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--models", nargs="*", help="NAME@MASK; default: all")
    parser.add_argument("--draws", type=int, default=5, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    options = parser.parse_args(argv)
    board = options.leaderboard
    found: dict[str, dict[str, Bootstrap]] = {}
    for name in options.models or list_models(board):
        found[name] = {
            told: bootstrap(
                measure_models(
                    open_folds(board, name),
                    tally_surroundings,
                    mask=mask_of(board, name, MASK),
                    draws=options.draws,
                    without=without,
                ),
                resamples=options.resamples,
            )
            for told, without in WITHOUT.items()
        }
    nodes = next(iter(found.values()))["both"].nodes
    known = [evidence for evidence in EVIDENCE if nodes[evidence]]
    if not known:
        raise DatasetError(f"{board}: no unvisited room has a known floor area or room label")
    data = open_dataset(board, next(iter(found)))
    page = ResultsPage(
        "What floor area and room label tell about a room",
        conclude(found, known),
        tuple(tabulate(found, evidence) for evidence in known),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
