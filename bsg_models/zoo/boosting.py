"""Fit boosted trees with a Poisson loss, one model per class: the best result without a network.

    H_c | x ~ NB(f · exp(trees_c(x)), r_c)

x describes the room's seen objects, its mask and its building. f is the hidden share, an offset of
the trees. r is fitted afterwards to the residuals of the trees. LightGBM (extra `boosting`) grows
the trees and writes them as text, which the checkpoint holds. Training holds all rooms in memory,
at most `bsg_models.zoo.masked_rooms.MOST_ROOMS`; of more rooms it reads a sample.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import torch
from pydantic import Field

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.extras import ask_to_install
from bsg_data.files import encode_json
from bsg_data.inputs.bounds import MAX_RATIO
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import MIN_RATE, CountDistribution, negative_binomial
from bsg_models.errors import CheckpointError, TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.gamma_poisson import fit_dispersion
from bsg_models.zoo.masked_rooms import choose_buildings, describe_sample, sample_chosen
from bsg_models.zoo.model import ModelInputs, others_of, to_array
from bsg_models.zoo.settings import DataConfig, ModelConfig
from bsg_models.zoo.training_recipes import VARIED
from bsg_models.zoo.tree_text import prove_trees

_MOST_BYTES = 2**28  # of unpacked trees; the recipe's trees take some megabytes
# Limits on LightGBM's text, so that a small file cannot ask for more:
_HEAD_BYTES, _FEATURE_BYTES = 2**16, 2**7  # per class, and per feature; a tenth is usual
_TREE_BYTES, _LEAF_BYTES = 2**10, 2**9


TreeReading = Literal["mask", "building", "categories"]


class BoostingConfig(ModelConfig):
    """Boosted trees with a Poisson loss, one model per class (LightGBM).

    Attributes:
        trees: of each class.
        leaves: of each tree.
        learning_rate: of boosting.
        draws: masks of every training building.
        reads: evidence besides a room's own histogram; see `NodeFeatures`.
        calibrate: fit the calibration on the val buildings.
    """

    family: Literal["poisson-boosting"] = "poisson-boosting"
    trees: int = Field(default=80, ge=1, le=10_000)
    leaves: int = Field(default=15, ge=2, le=1024)
    learning_rate: float = Field(default=0.06, gt=0, le=1)
    draws: int = Field(default=5, ge=1, le=1000)
    reads: tuple[TreeReading, ...] = ("mask", "building", "categories")
    calibrate: bool = True


class PoissonBoosting(CalibratedModel):
    """Boosted trees, fitted on masks of the training rooms.

    Attributes:
        trees: LightGBM's text of the trees of all classes, compressed.
        dispersions: `[C]` r.
    """

    trees: torch.Tensor
    dispersions: torch.Tensor

    config: BoostingConfig

    def __init__(self, config: BoostingConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.register_buffer("trees", torch.zeros(0, dtype=torch.uint8))
        self.register_buffer("dispersions", torch.ones(inputs.classes, dtype=torch.float64))
        self._boosters: list[tuple[float, Any]] = []

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Grow the trees of every class."""
        lightgbm = _import_lightgbm()
        scenes, every = choose_buildings(data, choice), scenes_of(data, "train", fold=choice.fold)
        if len(scenes) < len(every):
            self.notes = (describe_sample(len(scenes), len(every)),)
        masked = sample_chosen(
            data, choice, scenes, draws=self.config.draws, vocabulary=self.vocabulary
        )
        share = masked.seen.hidden_share.astype(np.float64)
        rows = ~masked.seen.is_building & (share > 0)
        if not rows.any():
            raise TrainingError("the masks of poisson-boosting hide nothing: raise data.fractions")
        features, offset = self._describe(masked.seen)[rows], np.log(share[rows])
        hidden = masked.hidden[rows].astype(np.float64)
        texts, rates = [], np.empty_like(hidden)
        for c, counts in enumerate(hidden.T):
            if not counts.any():  # nothing to learn: a weak prior of half an object in all rooms
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
        packed = zlib.compress(encode_json(texts).encode(), level=6)
        self.trees = torch.frombuffer(bytearray(packed), dtype=torch.uint8).clone()
        self._boosters = self._read(packed)

    def resize_buffers(self, state: Mapping[str, torch.Tensor]) -> None:
        """Make room for the trees of a checkpoint, and read them.

        Raises:
            CheckpointError: if they are not the trees of this model.
        """
        packed = state.get("trees")
        if packed is not None and packed.dtype == torch.uint8 and packed.ndim == 1:
            self.trees = torch.zeros_like(packed)
            self._boosters = self._read(packed.numpy().tobytes())

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the distribution that the trees give."""
        features, share = self._describe(seen), seen.hidden_share[:, None].astype(np.float64)
        rates = np.zeros((len(features), len(self.dispersions)))
        for c, (start, booster) in enumerate(self._boosters):
            grown = booster.predict(features, raw_score=True, num_threads=1) if booster else 0.0
            rates[:, c] = start + grown
        dispersions = np.broadcast_to(to_array(self.dispersions), rates.shape)
        return negative_binomial(share * np.exp(np.minimum(rates, 6.0)), dispersions)

    def _read(self, packed: bytes) -> list[tuple[float, Any]]:
        """Return start and trees of every class; None for a class that was never hidden."""
        lightgbm = _import_lightgbm()
        unpacking = zlib.decompressobj()
        try:
            most = self._most_bytes(len(packed))
            text = unpacking.decompress(packed, most)
            if unpacking.unconsumed_tail:
                raise ValueError(
                    f"they unpack to more than {most:,} bytes, the limit for such trees"
                )
            texts = parse_json(text)
            if len(texts) != len(self.dispersions):
                raise CheckpointError("the trees are of another model")
            grown = [
                (float(one["start"]), self._grow(lightgbm, one["trees"]) if one["trees"] else None)
                for one in texts
            ]
        except (zlib.error, ValueError, KeyError, TypeError, lightgbm.basic.LightGBMError) as error:
            raise CheckpointError(f"the trees are damaged ({error})") from error
        if not np.isfinite([start for start, _ in grown]).all():
            raise CheckpointError("the trees are damaged (a start is not finite)")
        return grown

    def _grow(self, lightgbm: Any, text: object) -> Any:
        if not isinstance(text, str):
            raise TypeError("trees are text")
        trees, leaves = self.config.trees, self.config.leaves
        proven = prove_trees(text, trees=trees, leaves=leaves, features=self._width())
        return lightgbm.Booster(model_str=proven)

    def _most_bytes(self, packed: int) -> int:
        """Return how much text the trees may unpack to, by the configuration and the file."""
        classes, trees = len(self.dispersions), self.config.trees
        heads = classes * (_HEAD_BYTES + _FEATURE_BYTES * self._width())
        grown = classes * trees * (_TREE_BYTES + _LEAF_BYTES * self.config.leaves)
        return min(heads + min(grown, MAX_RATIO * packed), _MOST_BYTES)

    def _width(self) -> int:
        """Return F, the number of features per node."""
        classes, reads = len(self.dispersions), self.config.reads
        return (
            classes
            + 1
            + 2 * ("mask" in reads)
            + (classes + 1) * ("building" in reads)
            + len(self.vocabulary) * ("categories" in reads)
        )

    def _describe(self, seen: Observation) -> Floats:
        """Return the features of every node, `[N, F]`."""
        counts, building = seen.inputs.astype(np.float64), seen.building
        parts = [counts, counts.sum(axis=1, keepdims=True)]
        if "mask" in self.config.reads:
            parts += [seen.hidden_share[:, None], seen.visited[:, None]]
        if "building" in self.config.reads:
            rooms = np.diff(seen.starts)[building][:, None]
            parts += [counts[seen.starts[:-1]][building] - counts, rooms]
        if "categories" in self.config.reads:
            parts.append(others_of(seen, self.vocabulary) > 0)
        return np.hstack([part.astype(np.float64) for part in parts])

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
            "seed": torch.initial_seed() % 2**31,  # the run's, see bsg_models.training.training
            "verbosity": -1,
        }


def _import_lightgbm() -> Any:
    try:
        import lightgbm
    except (ImportError, OSError) as error:  # OSError: its OpenMP library is missing
        raise TrainingError(
            f"poisson-boosting needs lightgbm: {ask_to_install('boosting')}"
        ) from error
    return lightgbm


POISSON_BOOSTING = ZooRow(BoostingConfig(), PoissonBoosting, data=VARIED)
