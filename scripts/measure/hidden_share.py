"""Measure how much models lose without the true hidden share, and gain by estimates of it.

    python scripts/measure/hidden_share.py --data hm3d --models run --out FIGURES

A mask knows the true share of every half-seen room. A model is asked about the same rooms with the
true share, with one half, and with uncertain shares that it integrates over. `--look` is ν of an
estimate's Beta distribution: how sure the estimate is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from folds import Shares, bootstrap
from results import ResultsTable, format_estimate, write_figures

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.hidden_share import CURVES, VAGUE, ShareBelief
from bsg_data.observation.masked_graph import mask_dataset
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.predictor import Predictor

MASK = MaskRecipe(strategy="explore")
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


def tally(found: Expectation, hidden: Counts, rooms: Sequence[int]) -> Shares:
    """Return what each of some rooms adds to the means over its classes, `[rooms]`."""
    said, there = np.clip(found.presence[rooms], 1e-6, 1 - 1e-6), hidden[rooms] > 0
    loss = -np.where(there, np.log(said), np.log1p(-said)).sum(axis=1)
    sums = {
        "nll": -found.log_probability(hidden.astype(float))[rooms].reshape(len(rooms), -1).sum(1),
        "log_loss": loss,
        "brier": ((said - there) ** 2).sum(axis=1),
        "said": said.sum(axis=1),
        "true": there.sum(axis=1),
        "expected": found.hidden[rooms].sum(axis=1),
        "hidden": hidden[rooms].sum(axis=1),
    }
    cells = np.full(len(rooms), float(hidden.shape[1]))
    return {name: (values.astype(float), cells) for name, values in sums.items()}


def measure(
    predictor: Predictor, cases: Sequence[tuple[int, PartialGraph, Counts]], *, size: float
) -> dict[str, tuple[Bootstrap, float]]:
    """Return the means of each way, and the root mean square error of the share's mean."""
    batches: dict[str, list[tuple[int, Sequence[str], Shares]]] = {way: [] for way in WAYS}
    errors: dict[str, list[float]] = {way: [] for way in WAYS}
    for draw, graph, truth in cases:
        rooms = [n for n, room in enumerate(graph.rooms, 1) if 0 < room.hidden_share < 1]
        if not rooms:
            continue
        told = list_told(graph, draw=draw, size=size)
        for way, (name, update) in WAYS.items():
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


def tabulate(title: str, found: Mapping[str, tuple[Bootstrap, float]]) -> ResultsTable:
    """Return the means, a row a way."""
    true = found[TRUE][0]
    rows = []
    for way, (means, error) in found.items():
        gap = means.difference(true, "nll")
        point = means.point
        rows.append(
            (
                way,
                f"{error:.2f}",
                f"{point['nll']:.4f}",
                "" if way == TRUE else format_estimate(gap, signed=True),
                "" if way == TRUE else f"{100 * gap.value / true.point['nll']:+.1f} %",
                f"{point['log_loss']:.4f}",
                f"{point['brier']:.4f}",
                f"{point['said'] / point['true']:.2f}",
                f"{point['expected'] / point['hidden']:.2f}",
            )
        )
    reading = (
        f"Means over {true.nodes['nll']:,} (room, class, mask) cells of half-seen rooms of the val "
        f"and test buildings. Masks: {MASK}. Differences are paired, with 95 % intervals over "
        "buildings. The error of the share is the root mean square error of its mean. A shipped "
        "model was trained on these buildings; a run was calibrated on the val buildings."
    )
    header = (
        *("told", "error of the share", "−log P(hidden counts)", "difference from true share"),
        *("relative", "log-loss of presence", "Brier", "presence predicted / true"),
        "counts expected / true",
    )
    return ResultsTable(title, header, rows, reading)


def read_cases(data: Dataset, *, draws: int) -> Iterator[tuple[int, PartialGraph, Counts]]:
    """Yield (draw, masked graph, true histograms) of every val and test building."""
    scenes = {scene for split in ("val", "test") for scene in scenes_of(data, split)}
    for draw in range(draws):
        for graph, truth in mask_dataset(data.path, scenes, MASK, draw=draw):
            yield draw, graph, truth


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="dataset with a split")
    parser.add_argument("--models", nargs="+", required=True, help="runs, or shipped models")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--draws", type=int, default=2, help="masks of every building")
    parser.add_argument("--look", type=float, default=CURVES["floor"][1])
    options = parser.parse_args(argv)
    data = Dataset.open(options.data)
    cases = list(read_cases(data, draws=options.draws))
    tables = []
    for name in options.models:
        predictor = Predictor(name)
        tables.append(tabulate(predictor.name, measure(predictor, cases, size=options.look)))
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "hidden_share", tables, argv=words, data=data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
