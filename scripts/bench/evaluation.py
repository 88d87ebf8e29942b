"""Measure how fast an evaluation is beside scikit-learn's metrics on the same arrays.

A user of scikit-learn ranks the (room, class) cells by presence, all in one ranking and class by
class, and asks for the Brier score, for each selection of cells. The evaluation gives these and all
other metrics; the second row is the default, with an interval for each from resampled buildings.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from timing import Speed, time_both

from bsg_data.arrays import Floats
from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.recipes import PairsRecipe
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.measurement import Fold, predict_all, read_truth
from bsg_models.evaluation.measurement import measure as measure_model
from bsg_models.evaluation.presence import select_cells
from bsg_models.evaluation.truth import Truth
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.found_model import locate_run
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.studies.comparison import EvaluationRequest
from bsg_models.studies.stored_pairs import stream_batches

BUILDINGS = 36
TARGET = 0.008  # seconds of a building and model


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield the evaluation of a model's predictions, a building: without intervals, and with."""
    with tempfile.TemporaryDirectory() as folder:
        source = hm3d or Path(folder, "buildings")
        if hm3d is None:
            list(write_synthetic(source, scenes=BUILDINGS, seed=0))
        build_dataset(HM3DFolder(source), Path(folder, "dataset"))
        batches = list(predict(Dataset.open(Path(folder, "dataset"))))
    scenes = tuple(dict.fromkeys(scene for truth, _ in batches for scene in truth.scene_ids))

    def ours(resamples: int = 0) -> dict[str, float]:
        told = ((truth, forget(found)) for truth, found in batches)
        return measure_model([Fold(scenes, told)], resamples=resamples).point

    resamples = EvaluationRequest.model_fields["resamples"].default
    what = "evaluation, a building and model with 10 masks: all values"
    often = f"{what}, on {resamples} resamples"
    for name, number in ((what, 0), (often, resamples)):
        began = time.process_time()
        ours(number)
        taken = (time.process_time() - began) / len(scenes)
        yield Speed(name, "", taken, None, TARGET)
    try:
        theirs = score_with_scikit_learn(batches)
    except ImportError:
        print("no scikit-learn to compare with: pip install scikit-learn", file=sys.stderr)
        return
    found = ours()
    for name, value in theirs.items():
        np.testing.assert_allclose(found[name], value, atol=2e-3, err_msg=name)
    one, other = time_both(ours, lambda: score_with_scikit_learn(batches), repeats=3)
    against = f"scikit-learn's metrics, {len(theirs)} values"
    yield Speed(what, against, one / len(scenes), other / len(scenes), 1, at_least=True)
    against += f", their time × {1 + resamples}"
    yield Speed(often, against, taken, other * (1 + resamples) / len(scenes), 1, at_least=True)


def predict(data: Dataset) -> Iterator[tuple[Truth, Expectation]]:
    """Yield truth and predictions of a shipped model, all classes and the last buildings."""
    path = checkpoint_of(locate_run("universal"))
    model = restore_model(path, load_checkpoint(path))
    last = set(data.scene_ids[-BUILDINGS:])
    masks = stream_batches(
        data, "test", fold=None, vocabulary=model.vocabulary, fresh=PairsRecipe()
    )
    for masked in masks:
        own = [number for number, scene in enumerate(masked.seen.scene_ids) if scene in last]
        if own:
            some = masked.take(own)
            yield read_truth(some), predict_all(model, some)


def forget(found: Expectation) -> Expectation:
    """Return predictions of which nothing is computed yet."""
    counts = found.hidden_counts
    return Expectation(found.inputs, counts.take(np.arange(len(found.inputs))), found.raw_totals)


def score_with_scikit_learn(batches: list[tuple[Truth, Expectation]]) -> dict[str, float]:
    """Return the metrics of presence that scikit-learn has, by our names."""
    from sklearn.metrics import average_precision_score, brier_score_loss, roc_auc_score

    def join(parts: list[Floats]) -> Floats:
        return np.concatenate(parts)

    rooms = [~truth.is_building for truth, _ in batches]
    both = list(zip(batches, rooms, strict=True))
    presence = join([forget(found).presence[own] for (_, found), own in both])
    seen = join([truth.inputs[own] for (truth, _), own in both]) > 0
    hidden = join([truth.hidden[own] for (truth, _), own in both]) > 0
    visited = join([truth.visited[own] for (truth, _), own in both])
    known = join([truth.known[own] for (truth, _), own in both])
    scores: dict[str, float] = {}
    for part, keep in select_cells(seen, visited, known).items():
        if not keep.any():
            continue
        name = f"rooms/{{}}/{part}".format
        truth, score = hidden[keep], presence[keep]
        scores[name("presence_auroc_micro")] = roc_auc_score(truth, score)
        scores[name("presence_ap_micro")] = average_precision_score(truth, score)
        scores[name("presence_brier")] = brier_score_loss(truth, score)
        columns = [
            (hidden[own, c], presence[own, c])
            for c, own in enumerate(keep.T)
            if hidden[own, c].any()
        ]
        ranked = [roc_auc_score(*two) for two in columns if not two[0].all()]
        scores[name("presence_auroc_macro")] = float(np.mean(ranked))
        precise = [average_precision_score(*two) for two in columns]
        scores[name("presence_ap_macro")] = float(np.mean(precise))
    return scores
