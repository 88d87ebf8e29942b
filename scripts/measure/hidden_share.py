"""Measure how much a model loses without the true hidden share, and gains by estimates of it.

    python scripts/measure/hidden_share.py --leaderboard board --out docs/results/figures.json

A mask knows the true share of every half-seen room. A model is asked about the same rooms, in
buildings that it was not trained on, with the true share, with one half, and with uncertain shares
that it integrates over.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from folds import Shares, bootstrap, open_dataset, open_folds
from results import ResultsTable, format_estimate, write_figures

from bsg_data.arrays import Counts
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.hidden_share import CURVES, VAGUE, ShareBelief
from bsg_models.belief.masked_graph import mask_dataset
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.runs.predictor import Predictor

MASK = MaskRecipe(strategy="explore")
SURE = CURVES["floor"][1]  # ν of an estimate's Beta distribution: how sure the estimate is
TRUE = "the true share"
WAYS = {  # row of the table → what the model is told, and whether what was seen updates it
    TRUE: ("true", False),
    "one half": ("half", False),
    "no estimate, integrated over": ("vague", False),
    "no estimate, updated by what was seen": ("vague", True),
    "an estimate, its mean only": ("mean", False),
    "an estimate, integrated over": ("look", False),
    "an estimate, updated by what was seen": ("look", True),
}


def tell(graph: PartialGraph, believe: Callable[[int, float], ShareBelief]) -> PartialGraph:
    """Return the graph with `believe(number, true share)` as the share of each half-seen room."""
    rooms = []
    for number, room in enumerate(graph.rooms):
        half_seen = 0 < room.hidden_share < 1
        share = believe(number, room.hidden_share) if half_seen else room.share
        rooms.append(replace(room, hidden_share=share.mean, hidden_share_sd=share.sd))
    shares = [room.hidden_share for room in rooms]
    return replace(graph, rooms=tuple(rooms), hidden_share=graph.share_with(shares))


def estimate(rng: np.random.Generator, share: float) -> ShareBelief:
    """Return an estimate of a share whose error fits its own standard deviation."""
    share = min(max(share, 0.02), 0.98)
    mean = float(np.clip(rng.beta(SURE * share, SURE * (1 - share)), 0.02, 0.98))
    return ShareBelief(mean, (mean * (1 - mean) / (SURE + 1)) ** 0.5)


def list_told(graph: PartialGraph) -> dict[str, PartialGraph]:
    """Return the graph as a model is told it in each way, before any update."""
    rng = np.random.default_rng([*graph.scene_id.encode()])
    looks = [estimate(rng, room.hidden_share) for room in graph.rooms]
    return {
        "true": graph,
        "half": tell(graph, lambda *_: ShareBelief(0.5)),
        "vague": tell(graph, lambda *_: VAGUE),
        "mean": tell(graph, lambda number, _: ShareBelief(looks[number].mean)),
        "look": tell(graph, lambda number, _: looks[number]),
    }


def tally(found: Expectation, hidden: Counts, rooms: Sequence[int]) -> Shares:
    """Return what each of some rooms adds to the means over its classes, `[rooms]`."""
    said, there = found.presence[rooms], hidden[rooms] > 0
    sums = {
        "nll": -found.log_probability(hidden.astype(float))[rooms].sum(axis=1),
        "brier": ((said - there) ** 2).sum(axis=1),
        "said": said.sum(axis=1),
        "true": there.sum(axis=1),
        "expected": found.hidden[rooms].sum(axis=1),
        "hidden": hidden[rooms].sum(axis=1),
    }
    cells = np.full(len(rooms), float(hidden.shape[1]))
    return {name: (values.astype(float), cells) for name, values in sums.items()}


def read_cases(options: argparse.Namespace) -> Iterator[tuple[Predictor, PartialGraph, Counts]]:
    """Yield every masked building with its true histograms, and the model trained without it."""
    for fold in open_folds(options.leaderboard, options.model, options.folds):
        predictor = Predictor(fold.run)
        for graph, truth in mask_dataset(fold.data.path, fold.scenes, MASK):
            yield predictor, graph, truth


def measure(
    cases: Iterator[tuple[Predictor, PartialGraph, Counts]],
) -> dict[str, tuple[Bootstrap, float]]:
    """Return the means of each way, and the root mean square error of the share's mean."""
    batches: dict[str, list[tuple[int, Sequence[str], Shares]]] = {way: [] for way in WAYS}
    errors: dict[str, list[float]] = {way: [] for way in WAYS}
    for predictor, graph, truth in cases:
        rooms = [n for n, room in enumerate(graph.rooms, 1) if 0 < room.hidden_share < 1]
        told = list_told(graph)
        for way, (name, update) in WAYS.items() if rooms else ():
            shares = [room.share for room in told[name].rooms]
            if update:
                shares = [*predictor.believe_shares(told[name])]
            found = predictor(told[name], weigh_seen=update)
            added = tally(found, truth - graph.histograms(), rooms)
            batches[way].append((0, [graph.scene_id] * len(rooms), added))
            errors[way] += [shares[n - 1].mean - graph.rooms[n - 1].hidden_share for n in rooms]
    return {
        way: (
            bootstrap(batches[way], resamples=1000),
            float(np.sqrt(np.mean(np.square(errors[way])))),
        )
        for way in WAYS
    }


def tabulate(found: Mapping[str, tuple[Bootstrap, float]], buildings: int) -> ResultsTable:
    """Return the means, a row a way."""
    true, rows = found[TRUE][0], []
    for way, (means, error) in found.items():
        gap, point = means.difference(true, "nll"), means.point
        told = way != TRUE
        rows.append(
            (
                way,
                f"{error:.2f}",
                f"{point['nll']:.4f}",
                format_estimate(gap, signed=True) if told else "",
                f"{100 * gap.value / true.point['nll']:+.1f} %" if told else "",
                f"{point['brier']:.4f}",
                f"{point['said'] / point['true']:.2f}",
                f"{point['expected'] / point['hidden']:.2f}",
            )
        )
    reading = (
        f"Half-seen rooms of {buildings} buildings under `explore` masks, each by a model that was "
        "not trained on it. Differences are paired, with 95 % intervals over buildings. The error "
        "of the share is the root mean square error of its mean."
    )
    header = (
        *("told", "error of the share", "−log P(hidden counts)", "difference from true share"),
        *("relative", "Brier", "presence predicted / true", "counts expected / true"),
    )
    return ResultsTable("What is said of the share", header, rows, reading, tested_on="unseen")


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--model", default="universal@mixed", help="NAME@MASK")
    parser.add_argument("--folds", nargs="*", type=int, help="to measure; default: all")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    options = parser.parse_args(argv)
    cases = list(read_cases(options))
    table = tabulate(measure(iter(cases)), len({graph.scene_id for _, graph, _ in cases}))
    data = open_dataset(options.leaderboard, options.model)
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "hidden_share", [table], argv=words, data=data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
