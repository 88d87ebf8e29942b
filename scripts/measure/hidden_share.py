"""Measure how much models lose without the true hidden share, and gain by estimates of it.

    python scripts/measure/hidden_share.py --data hm3d --models run --out PAGE

A mask knows the true share of every half-seen room. The script asks a model about the same rooms
with the true share, with one half, and with uncertain shares that the model integrates over. It
compares the likelihood of the hidden objects. `--look` is ν of an estimate's Beta distribution: how
sure the estimate is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
from building_means import BuildingMeans
from results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    write_page,
)

from bsg_data.arrays import Counts, Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.hidden_share import CURVES, VAGUE, ShareBelief
from bsg_data.observation.partial_graph import PartialGraph, mask_dataset
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Bootstrap, bootstrap
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.found_model import find_model
from bsg_models.runs.predictor import Predictor

MASK = MaskRecipe(strategy="explore")
LEARNED = "The model was trained on the val and test buildings"
CALIBRATED = "The model was calibrated on the val buildings and has not seen the test buildings"
LEAST = 1e-6  # keeps a presence this far from 0 and 1 before the logarithm
TRUE, NUMBER = "the true share", "an estimate, its mean only"
UPDATED = "an estimate, updated by what was seen"
WAYS = {  # row of the table → what the model is told, and whether what was seen updates it
    TRUE: ("true", False),
    "one half": ("half", False),
    "no estimate, integrated over": ("vague", False),
    "no estimate, updated by what was seen": ("vague", True),
    NUMBER: ("mean", False),
    "an estimate, integrated over": ("look", False),
    UPDATED: ("look", True),
}
MEANS = ("nll", "log_loss", "brier", "said", "true", "expected", "hidden")


def tell(graph: PartialGraph, believe: Callable[[int, float], ShareBelief]) -> PartialGraph:
    """Return the graph with `believe(number, true share)` as the share of each half-seen room."""
    rooms = []
    for number, room in enumerate(graph.rooms):
        share = room.share
        if 0 < room.hidden_share < 1:
            share = believe(number, room.hidden_share)
        rooms.append(replace(room, hidden_share=share.mean, hidden_share_sd=share.sd))
    shares = [room.hidden_share for room in rooms]
    return replace(graph, rooms=tuple(rooms), hidden_share=graph.share_with(shares))


def look(rng: np.random.Generator, share: float, size: float) -> ShareBelief:
    """Return an estimate of a share whose error fits its own standard deviation."""
    mean = float(np.clip(rng.beta(size * share, size * (1 - share)), 0.02, 0.98))
    return ShareBelief(mean, (mean * (1 - mean) / (size + 1)) ** 0.5)


def list_told(graph: PartialGraph, *, draw: int, size: float) -> dict[str, PartialGraph]:
    """Return the graph as a model is told it in each way, before any update."""
    rng = np.random.default_rng([draw, *graph.scene_id.encode()])
    looks = [look(rng, min(max(r.hidden_share, 0.02), 0.98), size) for r in graph.rooms]
    return {
        "true": graph,
        "half": tell(graph, lambda *_: ShareBelief(0.5)),
        "vague": tell(graph, lambda *_: VAGUE),
        "mean": tell(graph, lambda number, _: ShareBelief(looks[number].mean)),
        "look": tell(graph, lambda number, _: looks[number]),
    }


def weigh(found: Expectation, hidden: Counts, rooms: Sequence[int]) -> dict[str, float]:
    """Return the sums of `MEANS` over the classes of some rooms."""
    said = np.clip(found.presence[rooms], LEAST, 1 - LEAST)
    there = hidden[rooms] > 0
    return {
        "nll": -float(found.log_probability(hidden.astype(float))[rooms].sum()),
        "log_loss": -float(np.where(there, np.log(said), np.log1p(-said)).sum()),
        "brier": float(((said - there) ** 2).sum()),
        "said": float(said.sum()),
        "true": float(there.sum()),
        "expected": float(found.hidden[rooms].sum()),
        "hidden": float(hidden[rooms].sum()),
    }


def measure(
    predictor: Predictor, cases: Sequence[tuple[int, PartialGraph, Counts]], *, size: float
) -> tuple[dict[str, Bootstrap], dict[str, Floats]]:
    """Return the means of each way, and the error of each share's mean `[rooms]`."""
    sums: dict[str, dict[str, list[dict[str, float]]]] = {way: {} for way in WAYS}
    cells: dict[str, float] = {}
    errors: dict[str, list[float]] = {way: [] for way in WAYS}
    for draw, graph, truth in cases:
        rooms = [n for n, room in enumerate(graph.rooms, 1) if 0 < room.hidden_share < 1]
        if not rooms:
            continue
        hidden = truth - graph.histograms()
        cells[graph.scene_id] = cells.get(graph.scene_id, 0) + len(rooms) * truth.shape[1]
        told = list_told(graph, draw=draw, size=size)
        for way, (name, update) in WAYS.items():
            shares = [room.share for room in told[name].rooms]
            if update:
                shares = [*predictor.believe_shares(told[name])]
            found = weigh(predictor(told[name], weigh_seen=update), hidden, rooms)
            sums[way].setdefault(graph.scene_id, []).append(found)
            errors[way] += [shares[n - 1].mean - graph.rooms[n - 1].hidden_share for n in rooms]
    scenes = tuple(cells)
    number = np.array([cells[scene] for scene in scenes])
    found_of = {}
    for way, by_scene in sums.items():
        totals = {
            name: np.array([sum(one[name] for one in by_scene[scene]) for scene in scenes])
            for name in MEANS
        }
        means = BuildingMeans(scenes, totals, dict.fromkeys(MEANS, number))
        found_of[way] = bootstrap(means, resamples=1000)
    return found_of, {way: np.array(values) for way, values in errors.items()}


def tabulate(
    title: str,
    found: Mapping[str, Bootstrap],
    errors: Mapping[str, Floats],
    *,
    shipped: bool,
    again: bool = False,
) -> ResultsTable:
    """Return the means, a row a way.

    Args:
        title: name of the model.
        found: means of each way.
        errors: errors of the share's mean of each way.
        shipped: whether the model was trained on all buildings.
        again: whether a table above explains the values.
    """
    rows = []
    for way, means in found.items():
        gap = means.difference(found[TRUE], "nll")
        rows.append(
            (
                way,
                f"{np.sqrt((errors[way] ** 2).mean()):.2f}",
                f"{means.point['nll']:.4f}",
                "" if way == TRUE else format_estimate(gap, signed=True),
                f"{means.point['log_loss']:.4f}",
                f"{means.point['brier']:.4f}",
                f"{means.point['said'] / means.point['true']:.2f}",
                f"{means.point['expected'] / means.point['hidden']:.2f}",
            )
        )
    said = found[TRUE].nodes["nll"]
    known = LEARNED if shipped else CALIBRATED
    values = (
        "All else is as above."
        if again
        else f"Values are means over {said:,} (room, class, mask) cells of half-seen rooms of the "
        f"val and test buildings. Masks: {MASK}. Differences are paired, with 95 % intervals over "
        "buildings. The error of the share is the root mean square error of its mean. "
        "[Hidden share](../hidden-share.md) explains the estimates."
    )
    reading = f"{known}. {values}"
    header = (
        *("told", "error of the share", "−log P(hidden counts)", "difference from true share"),
        *("log-loss of presence", "Brier", "presence predicted / true", "counts expected / true"),
    )
    return ResultsTable(title, header, tuple(rows), reading)


def conclude(name: str, found: Mapping[str, Bootstrap]) -> str:
    """Return how much worse the likelihood is without the true share."""
    lost = {
        way: 100 * means.difference(found[TRUE], "nll").value / found[TRUE].point["nll"]
        for way, means in found.items()
    }
    best = min((way for way in lost if way.startswith("no estimate")), key=lost.__getitem__)
    return (
        f"`{name}`: −log P(hidden counts) is {lost['one half']:.1f} % higher when the model is "
        f"told one half than with the true share. It is {lost[best]:.1f} % higher with {best}. "
        f"It is {lost[NUMBER]:.1f} % higher with {NUMBER}, and {lost[UPDATED]:.1f} % higher with "
        f"{UPDATED}."
    )


def read_cases(
    data: Dataset, path: Path, *, draws: int
) -> Iterator[tuple[int, PartialGraph, Counts]]:
    """Yield (draw, masked graph, true histograms) of every val and test building."""
    scenes = {scene for split in ("val", "test") for scene in scenes_of(data, split)}
    for draw in range(draws):
        for graph, truth in mask_dataset(path, scenes, MASK, draw=draw):
            yield draw, graph, truth


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="dataset with a split")
    parser.add_argument("--models", nargs="+", required=True, help="runs, or shipped models")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--draws", type=int, default=2, help="masks of every building")
    parser.add_argument("--look", type=float, default=CURVES["floor"].size)
    options = parser.parse_args(argv)
    data = Dataset.open(options.data)
    cases = list(read_cases(data, options.data, draws=options.draws))
    tables: list[ResultsTable] = []
    conclusions = []
    for name in options.models:
        predictor = Predictor(name)
        found, errors = measure(predictor, cases, size=options.look)
        shipped = find_model(name).kind == "shipped"
        again = bool(tables)
        tables.append(tabulate(predictor.name, found, errors, shipped=shipped, again=again))
        conclusions.append(conclude(predictor.name, found))
    page = ResultsPage(
        "The cost of an unknown hidden share",
        tuple(conclusions),
        tuple(tables),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
