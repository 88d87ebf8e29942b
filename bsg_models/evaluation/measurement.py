"""Measure a model on stored pairs, batch by batch: every metric, on every resample of buildings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bsg_data.arrays import Bools
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings
from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation.bootstrap import Bootstrap, weigh_buildings
from bsg_models.evaluation.catalogue import METRICS, list_values, name_value
from bsg_models.evaluation.correlations import Correlations
from bsg_models.evaluation.metric import NodeMoments, Value, Weights
from bsg_models.evaluation.metrics import mean_known
from bsg_models.evaluation.presence import PresenceScores
from bsg_models.evaluation.truth import Prediction, Truth
from bsg_models.zoo.model import BeliefModel, one_thread

Measured = dict[str, Value]  # by name


def read_truth(masked: MaskedBuildings) -> Truth:
    """Return the truth of masked buildings, nodes in their order."""
    seen, known = masked.seen, masked.known
    scene_ids = tuple(dict.fromkeys(seen.scene_ids))
    number = {scene: i for i, scene in enumerate(scene_ids)}
    sizes = np.diff(seen.starts)
    return Truth(
        inputs=seen.inputs.astype(float),
        targets=np.where(known, masked.targets, 0).astype(float),
        is_building=seen.is_building,
        visited=seen.visited,
        building=np.repeat([number[scene] for scene in seen.scene_ids], sizes),
        draw=np.repeat(masked.draws, sizes),
        scene_ids=scene_ids,
        nameable=None if known.all() else known,
    )


def predict_all(model: BeliefModel, masked: MaskedBuildings) -> Expectation:
    """Return a model's expectation of every node of masked buildings, in their order."""
    return join([model.expect(some.seen) for some in masked.batches(BATCH)])


class Fold(NamedTuple):
    """What models are measured on, all on the same nodes."""

    scene_ids: Sequence[str]  # `[B]` of all its buildings
    # name of a model → its prediction of some nodes, in any order; read once, and not kept
    batches: Iterable[Mapping[str, Prediction]]


def measure(folds: Sequence[Fold], *, resamples: int = 0, seed: int = 0) -> dict[str, Bootstrap]:
    """Return every metric of each model, mean over the folds, and its value on every resample.

    A building has one weight in all folds that it is in. Scores of models trained separately for
    each fold cannot be pooled: a ranking or correlation over two trainings describes neither. A
    fold in which a metric is not defined, or of which a resample has no building, is left out of
    that mean.
    """
    weights = _weigh_folds([fold.scene_ids for fold in folds], resamples=resamples, seed=seed)
    with one_thread():
        measured = [measure_fold(*both) for both in zip(folds, weights, strict=True)]
    drawn = np.stack([own.any(axis=0) for own in weights])
    return {name: _average([fold[name] for fold in measured], drawn) for name in measured[0]}


def measure_fold(fold: Fold, weights: Weights) -> dict[str, Measured]:
    """Return every value of each model in a fold under weights `[B, W]` of its buildings."""
    rows, _ = METRICS.load_all()
    names, number_of = list_values(), {scene: place for place, scene in enumerate(fold.scene_ids)}
    scores: dict[str, tuple[NodeMoments, PresenceScores, Correlations]] = {}
    for batch in fold.batches:
        for name, prediction in batch.items():
            if name not in scores:
                means = NodeMoments(rows, weights)
                scores[name] = means, PresenceScores(weights), Correlations(weights)
            truth = prediction.truth
            building = np.array([number_of[scene] for scene in truth.scene_ids])[truth.building]
            for score in scores[name]:
                score.add(prediction, building)
    measured = {}
    for name, own in scores.items():
        found = {name_value(*key): value for score in own for key, value in score.finish().items()}
        measured[name] = {value: found[value] for value in names}
    return measured


def _weigh_folds(folds: Sequence[Sequence[str]], *, resamples: int, seed: int) -> list[Weights]:
    """Return the weights of the buildings of each fold, `[B, 1 + resamples]`."""
    every = {scene for fold in folds for scene in fold}
    scene_ids = folds[0] if len(folds) == 1 else sorted(every)
    number = {scene: place for place, scene in enumerate(scene_ids)}
    weights = weigh_buildings(len(scene_ids), resamples=resamples, seed=seed)
    return [weights[[number[scene] for scene in fold]] for fold in folds]


def _average(folds: Sequence[Measured], drawn: Bools) -> Bootstrap:
    """Return the means over folds of the values that exist, `drawn` `[F, W]`, and are not nan."""
    values = {}
    for name in folds[0]:
        own = np.stack([fold[name].weighted for fold in folds])
        values[name] = own[0] if len(own) == 1 else mean_known(np.where(drawn, own, np.nan))
    return Bootstrap(
        point={name: float(value[0]) for name, value in values.items()},
        resampled={name: value[1:] for name, value in values.items()},
        nodes={name: sum(fold[name].nodes for fold in folds) for name in values},
    )
