"""Measure whether the hidden share that a mask tells a model is true, and which parts it shows.

    python scripts/measure/told_shares.py --data hm3d --out PAGE

Masks are drawn again for every building, `--draws` times. Shares are over all objects with a class,
of whatever building and draw.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path

import numpy as np
from results_page import ResultsPage, ResultsTable, describe, write_page

from bsg_data.arrays import Counts, Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.hidden_others import have_wholes, sample_hidden_others
from bsg_data.observation.masked_buildings import wholes_of
from bsg_data.observation.masks import sample_hidden_draws, sample_views
from bsg_data.observation.view import View
from bsg_data.recipes import MaskRecipe

STRATEGIES = ("uniform", "rooms", "frontier", "explore", "search")
FRACTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)
PARTS = {  # row of the table → masks that it is of
    "`uniform` at .5": (MaskRecipe(),),
    "`explore`": (MaskRecipe(strategy="explore"),),
    "any, with `--parts`": tuple(MaskRecipe(strategy=name, parts=True) for name in STRATEGIES),
}


def draw_masks(
    data: Dataset, recipe: MaskRecipe, draws: int
) -> Iterator[tuple[str, int, View, Counts]]:
    """Yield (scene, draw, view, hidden objects with a class `[N, C]`) of every building."""
    for scene in data.scene_ids:
        cells, numbers = data.cells(scene), range(draws)
        known = data.connections(scene)
        views = list(
            sample_views(cells.shape, recipe, scene_id=scene, draws=numbers, connections=known)
        )
        hidden = sample_hidden_draws(cells, views, recipe, scene_id=scene, draws=numbers)
        yield from ((scene, draw, views[draw], hidden[draw]) for draw in numbers)


def compare_shares(data: Dataset, recipe: MaskRecipe, draws: int) -> Floats:
    """Return the told and the true share, of buildings and of entered rooms, `[2, 2]`."""
    sums = np.zeros((2, 3))
    for scene, _, view, hidden in draw_masks(data, recipe, draws):
        there, gone = data.cells(scene).sum(axis=1), hidden.sum(axis=1)
        entered = view.visited.copy()
        entered[0] = False
        sums[0] += (view.hidden_share[0] * there.sum(), gone.sum(), there.sum())
        told = (view.hidden_share * there)[entered].sum()
        sums[1] += (told, gone[entered].sum(), there[entered].sum())
    return sums[:, :2] / np.maximum(sums[:, 2:], 1)


def count_parts(data: Dataset, recipe: MaskRecipe, draws: int) -> tuple[int, int]:
    """Return in how many rooms a class is hidden wholly beside a part, and how many show one.

    A room counts once for each class and draw.
    """
    found = shown = 0
    for scene, draw, view, hidden in draw_masks(data, recipe, draws):
        there, others = data.cells(scene), data.others(scene)
        wholes = wholes_of(others.categories, data)
        gone = sample_hidden_others(
            others.cells,
            view,
            recipe,
            scene_id=scene,
            draw=draw,
            there=there,
            hidden=hidden,
            wholes=wholes if recipe.parts else None,
        )
        parts = have_wholes(there, wholes) & (others.cells > 0) & (hidden == there)[:, wholes]
        seen = parts & (others.cells > gone)
        for index in np.unique(wholes[wholes >= 0]):
            found += int(parts[:, wholes == index].any(axis=1).sum())
            shown += int(seen[:, wholes == index].any(axis=1).sum())
    return found, shown


def tabulate_shares(shares: dict[tuple[str, float], Floats]) -> ResultsTable:
    """Return the table of told and true shares."""
    rows = [
        (
            f"`{name}`",
            f"{fraction}",
            *(f"{100 * told:.1f}, {100 * true:.1f}" for told, true in both),
        )
        for (name, fraction), both in shares.items()
    ]
    return ResultsTable(
        "Told and true shares",
        ("mask", "fraction", "building", "entered rooms"),
        tuple(rows),
        "A cell has the hidden share of the objects with a class in per cent, told and true.",
    )


def tabulate_parts(data: Dataset, draws: int) -> ResultsTable:
    """Return the table of the rooms that show a part of what they hide."""
    rows = []
    for name, recipes in PARTS.items():
        counts = np.array([count_parts(data, recipe, draws) for recipe in recipes]).sum(axis=0)
        share = counts[1] / counts[0] if counts[0] else np.nan
        rows.append((name, f"{100 * share:.0f} %" if share else "none"))
    return ResultsTable(
        "Parts that are seen",
        ("mask", "rooms where a part is seen"),
        tuple(rows),
        "Of the rooms that hold a class and a part of it, and whose things of the class are all "
        "hidden.",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="dataset of bsg-data build")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--draws", type=int, default=40, help="masks of every building")
    options = parser.parse_args(argv)
    data = Dataset.open(options.data)
    shares = {
        (name, fraction): compare_shares(
            data, MaskRecipe(strategy=name, fraction=fraction), options.draws
        )
        for name in STRATEGIES
        for fraction in FRACTIONS
    }
    wrong = max(float(np.abs(np.diff(both, axis=1)).max()) for both in shares.values())
    conclusion = (
        "What a mask tells a model differs from the true hidden share by at most "
        f"{100 * wrong:.2f} percentage points, over {options.draws} draws of every building."
    )
    page = ResultsPage(
        "Hidden shares that masks tell",
        (conclusion,),
        (tabulate_shares(shares), tabulate_parts(data, options.draws)),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
