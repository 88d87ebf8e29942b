"""Boosted trees with a Poisson loss, one model a class: what is possible without a network.

    H_c | x ~ NB(f · exp(trees_c(x)), r_c)

x is what the room shows, its mask and its building; f the share that is hidden, an offset of the
trees. r is fitted afterwards to what the trees leave unexplained. LightGBM (extra `boosting`) grows
the trees and writes them as text, which is what a checkpoint holds.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_models.belief.count_distribution import (
    MIN_RATE,
    CountDistribution,
    Floats,
    negative_binomial,
)
from bsg_models.errors import CheckpointError, TrainingError
from bsg_models.inputs.graphs import Buildings
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.config import DataConfig
from bsg_models.zoo.families import BoostingConfig
from bsg_models.zoo.gamma_poisson import fit_dispersion
from bsg_models.zoo.masked_rooms import sample_chosen
from bsg_models.zoo.model import building_numbers, others_of, to_array

_MOST_BYTES = 2**28  # of unpacked trees; the recipe's are some megabytes


class PoissonBoosting(CalibratedModel):
    """Fitted by boosting on masks of the training rooms.

    Attributes:
        trees: bytes of the classes' trees as LightGBM writes them, compressed.
        dispersions: `[C]` r.
    """

    trees: torch.Tensor
    dispersions: torch.Tensor

    def __init__(self, config: BoostingConfig, classes: int, vocabulary: tuple[str, ...]) -> None:
        super().__init__()
        self.config = config
        self.vocabulary = vocabulary
        self.register_buffer("trees", torch.zeros(0, dtype=torch.uint8))
        self.register_buffer("dispersions", torch.ones(classes, dtype=torch.float64))
        self._boosters: list[tuple[float, Any]] = []

    def fit(self, data: Buildings, choice: DataConfig) -> None:
        """Grow the trees of every class."""
        lightgbm = _import_lightgbm()
        masked = sample_chosen(data, choice, draws=self.config.draws, vocabulary=self.vocabulary)
        share = to_array(masked.fraction)
        rows = ~masked.is_building.numpy() & (share > 0)
        if not rows.any():
            raise TrainingError("the masks of poisson-boosting hide nothing: raise data.fractions")
        features, offset = self._describe(masked)[rows], np.log(share[rows])
        hidden = to_array(masked.y - masked.x)[rows]
        texts, rates = [], np.empty_like(hidden)
        for c, counts in enumerate(hidden.T):
            if not counts.any():  # nothing to grow on: a weak prior of half an object in all rooms
                start = np.log(0.5 / share[rows].sum())
                rates[:, c] = np.exp(start + offset)
                texts.append({"start": float(start), "trees": None})
                continue
            start = np.log(max(counts.mean(), MIN_RATE) / max(share[rows].mean(), MIN_RATE))
            table = lightgbm.Dataset(features, counts, init_score=start + offset)
            booster = lightgbm.train(self._recipe(), table, self.config.trees)
            grown = booster.predict(features, raw_score=True, num_threads=1)
            rates[:, c] = np.exp(start + offset + grown)
            texts.append({"start": float(start), "trees": booster.model_to_string()})
        self.dispersions.copy_(torch.from_numpy(fit_dispersion(hidden, rates)))
        packed = zlib.compress(json.dumps(texts).encode(), level=6)
        self.trees = torch.frombuffer(bytearray(packed), dtype=torch.uint8).clone()
        self._boosters = self._read(packed)

    def resize_buffers(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take as many bytes of trees as the checkpoint has, and grow them from these.

        Raises:
            CheckpointError: if they are not the trees of this model.
        """
        found = state.get("trees")
        if found is not None and found.dtype == torch.uint8 and found.ndim == 1:
            self.trees = torch.zeros_like(found)
            self._boosters = self._read(found.numpy().tobytes())

    def predict_hidden_counts(self, graphs: Data) -> CountDistribution:
        """Return the distribution that the trees give."""
        features, share = self._describe(graphs), to_array(graphs.fraction)[:, None]
        rates = np.zeros((len(features), len(self.dispersions)))
        for c, (start, booster) in enumerate(self._boosters):
            grown = booster.predict(features, raw_score=True, num_threads=1) if booster else 0.0
            rates[:, c] = start + grown
        dispersions = np.broadcast_to(to_array(self.dispersions), rates.shape)
        return negative_binomial(share * np.exp(np.minimum(rates, 6.0)), dispersions)

    def _read(self, packed: bytes) -> list[tuple[float, Any]]:
        """Return start and trees of every class; None for the trees of a class that never hid."""
        lightgbm = _import_lightgbm()
        unpacking = zlib.decompressobj()
        try:
            texts = json.loads(unpacking.decompress(packed, _MOST_BYTES))
            found = [
                (float(one["start"]), _grow(lightgbm, one["trees"]) if one["trees"] else None)
                for one in texts
            ]
        except (zlib.error, ValueError, KeyError, TypeError, lightgbm.basic.LightGBMError) as error:
            raise CheckpointError(f"the trees are damaged ({error})") from error
        widths = {booster.num_feature() for _, booster in found if booster} | {self._width()}
        if len(found) != len(self.dispersions) or len(widths) > 1:
            raise CheckpointError("the trees are of another model")
        if not np.isfinite([start for start, _ in found]).all():
            raise CheckpointError("the trees are damaged (a start is not finite)")
        return found

    def _width(self) -> int:
        """Return F, what the trees read of every node."""
        classes, reads = len(self.dispersions), self.config.reads
        return (
            classes
            + 1
            + 2 * ("mask" in reads)
            + (classes + 1) * ("building" in reads)
            + len(self.vocabulary) * ("categories" in reads)
        )

    def _describe(self, graphs: Data) -> Floats:
        """Return what the trees read of every node, `[N, F]`."""
        seen, building = to_array(graphs.x), building_numbers(graphs).numpy()
        parts = [seen, seen.sum(axis=1, keepdims=True)]
        if "mask" in self.config.reads:
            parts += [to_array(graphs.fraction)[:, None], to_array(graphs.visited)[:, None]]
        if "building" in self.config.reads:
            first = np.flatnonzero(graphs.is_building.numpy())
            rooms = np.bincount(building)[building][:, None]
            parts += [seen[first][building] - seen, rooms]
        if "categories" in self.config.reads:
            parts.append(to_array(others_of(graphs, len(self.vocabulary))))
        return np.hstack(parts)

    def _recipe(self) -> dict[str, Any]:
        return {
            "objective": "poisson",
            "num_leaves": self.config.leaves,
            "learning_rate": self.config.learning_rate,
            "min_data_in_leaf": 30,
            "feature_fraction": 0.3,
            "bagging_fraction": 0.7,
            "bagging_freq": 1,
            "lambda_l2": 5.0,
            "boost_from_average": False,
            "deterministic": True,
            "force_row_wise": True,
            "num_threads": 1,
            "seed": torch.initial_seed() % 2**31,  # of the run, see bsg_models.training.training
            "verbosity": -1,
        }


def _grow(lightgbm: Any, text: object) -> Any:
    if not isinstance(text, str):
        raise TypeError("trees are text")
    return lightgbm.Booster(model_str=text)


def _import_lightgbm() -> Any:
    try:
        import lightgbm
    except (ImportError, OSError) as error:  # OSError: its OpenMP library is missing
        raise TrainingError(
            "poisson-boosting needs lightgbm: pip install 'belief-scene-graphs[boosting]'"
        ) from error
    return lightgbm
