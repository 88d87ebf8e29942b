"""Measure models on whole datasets of other buildings, in the rooms that nobody has entered.

    bsg-data build --source cobie clinic.xlsx --out clinic
    python scripts/measure/foreign.py --data clinic --models universal --out FIGURES

No building is trained on, so there is no split. Only the classes that a source can name count.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from folds import Shares, bootstrap, tally_unvisited
from results import ResultsTable, format_estimate, write_figures

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, stream_sampled
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.surroundings import EVIDENCE
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.evaluation.truth import Truth
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.found_model import find_model
from bsg_models.zoo.model import BeliefModel, one_thread

TOLD = {  # → evidence that is withheld
    "objects": tuple(EVIDENCE),
    "labels": ("floor_area", "building_kinds", "sources"),
    "labels, kind": ("floor_area", "sources"),
}
MACRO, MICRO = (f"rooms/presence_auroc_{kind}/unvisited" for kind in ("macro", "micro"))
COLUMNS = {"NLL ↓": "nll", "AUROC macro ↑": MACRO, "AUROC micro ↑": MICRO, "objects said": "said"}


def open_model(name: str) -> BeliefModel:
    """Return a shipped model by its name, or that of a run by its path."""
    found = find_model(Path(name) if Path(name).exists() else name)
    return restore_model(found.path, load_checkpoint(found.path))


def measure_model(
    model: BeliefModel, data: Dataset, *, without: Sequence[str], draws: int, resamples: int
) -> Bootstrap:
    """Return `nll`, `said`, `true` and the AUROC of rooms not entered, over all buildings.

    Args:
        model: that was trained on none of them.
        data: of any buildings.
        without: evidence that the model is not told.
        draws: `rooms` masks of every building.
        resamples: of the buildings; 0 for a single one, which has no interval.
    """
    batches: list[tuple[Truth, Expectation]] = []
    shares: list[tuple[int, Sequence[str], Shares]] = []
    mask = MaskRecipe(strategy="rooms")
    for draw in range(draws):
        for masked in stream_sampled(
            data, data.scene_ids, mask=mask, draw=draw, vocabulary=model.vocabulary
        ):
            truth, found = read_truth(masked), _predict(model, masked, without)
            batches.append((truth, found))
            scenes = np.array(truth.scene_ids)[truth.building]
            shares.append((0, scenes, tally_unvisited(truth, masked, found)))
    ranked = measure([Fold(data.scene_ids, batches)], resamples=resamples)
    means = bootstrap(shares, resamples=resamples)
    return Bootstrap(
        means.point | ranked.point, means.resampled | ranked.resampled, means.nodes | ranked.nodes
    )


def _predict(model: BeliefModel, masked: MaskedBuildings, without: Sequence[str]) -> Expectation:
    with one_thread():
        return predict_all(model, replace(masked, seen=masked.seen.without(*without)))


def report_dataset(options: argparse.Namespace, path: Path) -> ResultsTable:
    """Return a table of all models on one dataset, told objects alone or more."""
    data = Dataset.open(path)
    many = len(data.scene_ids) > 1
    rows, last = [], None
    for name in options.models:
        model, before = open_model(name), np.nan
        for told, without in TOLD.items():
            print(f"measures {name} on {path.name}, told {told}", file=sys.stderr, flush=True)
            last = measure_model(
                model,
                data,
                without=without,
                draws=options.draws,
                resamples=options.resamples if many else 0,
            )
            if last.point["nll"] != before:  # it reads what it was told
                cells = [format_estimate(last.estimate(c), digits=3) for c in COLUMNS.values()]
                rows.append([f"`{Path(name).name}`", told, *cells])
            before = last.point["nll"]
    assert last is not None
    totals, named = data.manifest.totals, int(data.nameable(data.scene_ids[0]).sum())
    what = f"{len(data.scene_ids)} scenes" if many else "one building, so there is no interval"
    reading = (
        f"{totals.rooms} rooms, {what}; {named} classes that the source can name. There are "
        f"{last.point['true']:.2f} objects of these in a room not entered "
        f"({last.nodes['true']:,} rooms over {options.draws} masks)."
        + (" Intervals are of 95 %, over scenes." if many else "")
        + " A model without a row for labels or for the kind of building does not read it."
    )
    return ResultsTable(path.name, ("model", "told", *COLUMNS), rows, reading)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="datasets")
    parser.add_argument("--models", nargs="+", required=True, help="shipped models, or runs")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    parser.add_argument("--draws", type=int, default=50, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    options = parser.parse_args(argv)
    tables = [report_dataset(options, path) for path in options.data]
    words = [__file__, *(argv or sys.argv[1:])]
    write_figures(options.out, "real_buildings", tables, argv=words)
    return 0


if __name__ == "__main__":
    sys.exit(main())
