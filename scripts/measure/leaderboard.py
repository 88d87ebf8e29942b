"""Write the leaderboard page of the docs from a finished leaderboard.

    bsg-leaderboard --data hm3d --masks uniform,rooms,explore --out board
    python scripts/measure/leaderboard.py --leaderboard board --out docs/results/leaderboard.md

It reads `leaderboard.json`. It trains and measures nothing.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from results_page import ResultsPage, ResultsTable, describe, write_page

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_models.studies.leaderboard import DATASET
from bsg_models.studies.leaderboard_report import REPORT

RANKED_BY = "rooms/hidden_nll"
COLUMNS = {
    "NLL ↓": RANKED_BY,
    "AUROC macro ↑": "rooms/presence_auroc_macro/all",
    "AUROC micro ↑": "rooms/presence_auroc_micro/all",
    "AUROC unseen ↑": "rooms/presence_auroc_macro/unseen",
    "calibration error ↓": "rooms/presence_calibration_error/all",
}
UNVISITED = {
    "AUROC macro ↑": "rooms/presence_auroc_macro/unvisited",
    "AP macro ↑": "rooms/presence_ap_macro/unvisited",
    "AP micro ↑": "rooms/presence_ap_micro/unvisited",
    "calibration error ↓": "rooms/presence_calibration_error/unvisited",
}
DILUTED = (
    "All rooms count here. Those that were entered hide nothing, so a model that only knows which "
    "rooms were entered has an AUROC well above 0.5."
)


def read_board(path: Path) -> dict[str, Any]:
    """Return a leaderboard's JSON.

    Raises:
        DatasetError: if it is missing or not a leaderboard.
    """
    try:
        board = json.loads(path.read_text("utf-8"))
        masks = {
            mask: {name: one["metrics"][RANKED_BY]["value"] for name, one in models.items()}
            for mask, models in board["masks"].items()
        }
        if not masks or not all(masks.values()):
            raise KeyError("masks")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DatasetError(
            f"{path}: expected a leaderboard's JSON, found none ({error!r}); run `bsg-leaderboard`"
        ) from error
    return dict(board)


def write_cell(value: dict[str, float | None] | None, *, digits: int = 4) -> str:
    """Return a value and half of its interval; – if there is none."""
    if value is None or value["value"] is None:
        return "–"
    low, high = value.get("low"), value.get("high")
    text = f"{value['value']:.{digits}f}"
    return text if low is None or high is None else f"{text} ± {(high - low) / 2:.1g}"


def rank(models: dict[str, Any]) -> list[str]:
    """Return the names of the models, the best first."""
    return sorted(models, key=lambda name: models[name]["metrics"][RANKED_BY]["value"])


def tabulate(mask: str, models: dict[str, Any]) -> ResultsTable:
    """Return the models under a mask, the best first."""
    ranked = rank(models)
    rows = []
    for name in ranked:
        one = models[name]
        cells = [write_cell(one["metrics"].get(metric)) for metric in COLUMNS.values()]
        ratio = write_cell(one.get("nll_over_gamma_poisson"), digits=3)
        gap = one.get("nll_minus_best")
        behind = "best" if name == ranked[0] else write_difference(gap)
        rows.append((f"`{name}`", cells[0], behind, ratio, *cells[1:], f"{one['seconds']:.0f}"))
    first, *others = COLUMNS
    header = ("model", first, "behind the best", "÷ gamma-poisson", *others, "training, s")
    return ResultsTable(f"Masks: {mask}", header, tuple(rows))


def tabulate_unvisited(mask: str, models: dict[str, Any]) -> ResultsTable:
    """Return the models in the rooms that were not entered, in the order of `tabulate`."""
    rows = tuple(
        (f"`{name}`", *(write_cell(models[name]["metrics"][one]) for one in UNVISITED.values()))
        for name in rank(models)
    )
    reading = "Only rooms of which nothing was seen. An AUROC of 0.5 is guessing."
    return ResultsTable(f"Rooms not entered, masks: {mask}", ("model", *UNVISITED), rows, reading)


def list_tables(board: dict[str, Any]) -> list[ResultsTable]:
    """Return a table for each kind of mask, and one more if it leaves rooms unentered."""
    tables = []
    for mask, models in board["masks"].items():
        table = tabulate(mask, models)
        if not has_unvisited(models):
            tables.append(table)
            continue
        tables += [replace(table, reading=DILUTED), tabulate_unvisited(mask, models)]
    return tables


def has_unvisited(models: dict[str, Any]) -> bool:
    """Say whether a mask left rooms unentered, so that they can be measured alone."""
    return all(
        (one["metrics"].get(metric) or {}).get("value") is not None
        for one in models.values()
        for metric in UNVISITED.values()
    )


def write_difference(gap: dict[str, float | None] | None) -> str:
    """Return a paired difference with its interval."""
    if gap is None or gap["value"] is None:
        return "–"
    if gap["low"] is None:
        return f"{gap['value']:+.4f}"
    return f"{gap['value']:+.4f} ({gap['low']:+.4f} to {gap['high']:+.4f})"


def conclude(board: dict[str, Any]) -> tuple[str, ...]:
    """Return the best model of each mask, the models level with it, and the setup."""
    sentences = []
    for mask, models in board["masks"].items():
        best = min(models, key=lambda name: models[name]["metrics"][RANKED_BY]["value"])
        level = [
            name
            for name, one in models.items()
            if name != best
            and (gap := one.get("nll_minus_best"))
            and gap["low"] is not None
            and gap["low"] <= 0
        ]
        names = ", ".join(f"`{n}`" for n in level)
        also = f"; not distinguishable from it: {names}" if level else ""
        nll = models[best]["metrics"][RANKED_BY]["value"]
        sentences.append(
            f"- Under `{mask}` masks, `{best}` has the lowest hidden NLL: {nll:.4f}{also}."
        )
    recipe = board["recipe"]
    how = (
        f"Setup: {recipe['folds']} folds by building; {recipe['draws']} masks of every test "
        f"building, each hides {100 * recipe['fraction']:g} %; seed {recipe['seed']}. Values are "
        "means over the folds. ± is half the 95 % interval over buildings. “Behind the best” is a "
        "paired difference of NLL; “÷ gamma-poisson” is the NLL divided by that of "
        "`gamma-poisson`. [Evaluation](../evaluation.md) defines the metrics."
    )
    return "\n".join(sentences), how


def main(argv: Sequence[str] | None = None) -> int:
    """Read the leaderboard and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--title", default="Leaderboard", help="heading of the page")
    parser.add_argument("--note", help="sentence after the conclusions")
    options = parser.parse_args(argv)
    board = read_board(options.leaderboard / REPORT)
    mask = next(iter(board["masks"]))
    command = [one for one in argv or sys.argv[1:] if one not in ("--note", options.note)]
    page = ResultsPage(
        options.title,
        (*conclude(board), *filter(None, [options.note])),
        tuple(list_tables(board)),
        describe(
            Dataset.open(options.leaderboard / mask / DATASET),
            [__file__, *command],
            date=date.today().isoformat(),
        ),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
