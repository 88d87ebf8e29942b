"""The stored pairs that models are measured on: what is in them, and predictions for them.

A dataset without a split is measured whole, under masks that are drawn for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import resolve_links, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.mask_hash import ALL, hash_splits
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings, stream_sampled
from bsg_data.recipes import PairsRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.measurement import predict_all, read_truth
from bsg_models.evaluation.prediction_files import PredictionWriter, read_predictions
from bsg_models.evaluation.predictions import AlignedPredictions, align
from bsg_models.evaluation.truth import Prediction
from bsg_models.inputs.folds import Split, scenes_of, splits_of
from bsg_models.inputs.graphs import stream_split
from bsg_models.zoo.model import BeliefModel


@dataclass(frozen=True, eq=False)
class MeasuredPairs:
    """The masked buildings that models are measured on."""

    data: Dataset
    split: Split
    folds: tuple[int | None, ...]  # (None,) without folds
    fresh: PairsRecipe | None = None  # masks of a dataset without a split, which is measured whole

    @property
    def recipe(self) -> PairsRecipe:
        """The recipe of the masks."""
        pairs = self.fresh or self.data.manifest.pairs
        if pairs is None:
            raise DatasetError(f"{self.data.path}: has no pairs; run `bsg-data pairs` first")
        return pairs

    @property
    def trains(self) -> bool:
        """Whether there are buildings for training."""
        return self.folds != (None,) or "train" in self.data.splits

    @property
    def masks_sha256(self) -> str:
        """The hash of the stored masks."""
        data = self.data
        names = {name for fold in self.folds for name in splits_of(data, self.split, fold=fold)}
        return hash_splits(data, sorted(names))[ALL]

    @cached_property
    def surveys(self) -> dict[int | None, pd.DataFrame]:
        """Fold → one row per masked building, from one reading.

        The columns are `scene_id`, `objects` (classified), `rooms`, and `empty_inputs` and
        `empty_targets`: all-zero nodes, of degenerate distances.
        """
        return {fold: self._survey(fold) for fold in self.folds}

    @cached_property
    def survey(self) -> pd.DataFrame:
        """The rows of all folds."""
        return pd.concat(self.surveys.values())

    @cached_property
    def buildings(self) -> tuple[str, ...]:
        """The buildings, the smallest first."""
        sizes = self.survey.groupby("scene_id", sort=False).objects.last()
        return tuple(sizes.sort_values(kind="stable").index)

    def stream(
        self, fold: int | None, *, vocabulary: tuple[str, ...] = ()
    ) -> Iterator[MaskedBuildings]:
        """Yield the pairs of a fold, at most `BATCH` masked buildings at a time."""
        if self.fresh is None:
            for masked in stream_split(self.data, self.split, fold=fold, vocabulary=vocabulary):
                yield from masked.batches(BATCH)
            return
        mask, scenes = self.fresh.mask, self.data.scene_ids
        for draw in range(self.fresh.draws):
            yield from stream_sampled(
                self.data, scenes, mask=mask, draw=draw, vocabulary=vocabulary
            )

    def predict(
        self, models: Mapping[str, BeliefModel | AlignedPredictions], fold: int | None
    ) -> Iterator[dict[str, Prediction]]:
        """Yield what models and files expect of the pairs of a fold, some buildings at a time."""
        read = {name: getattr(model, "vocabulary", ()) for name, model in models.items()}
        streams = {
            words: self.stream(fold, vocabulary=words) for words in dict.fromkeys(read.values())
        }
        for batch in zip(*streams.values(), strict=True):
            masked = dict(zip(streams, batch, strict=True))
            truths = {words: read_truth(some) for words, some in masked.items()}
            yield {
                name: Prediction(truths[read[name]], _expect(model, masked[read[name]]))
                for name, model in models.items()
            }

    def read_entry(self, path: Path) -> tuple[str, AlignedPredictions, dict[str, Any]]:
        """Read a file of predictions, or a folder of them, for the nodes that are measured.

        If only one of several folds is measured, rows of other folds are skipped.

        Returns:
            Name of the entry, what it predicts, and where it comes from.
        """
        data = self.data
        classes = data.manifest.class_space.classes
        predictions = read_predictions(path)
        ours = {self.masks_sha256, *hash_splits(data).values()}
        if strange := sorted(predictions.masks - ours):
            raise PredictionError(
                f"{path}: was made for other masks ({strange[0][:12]}…) than those of {data.path}; "
                "`bsg-data info` lists the masks of a dataset"
            )
        masked = (some for fold in self.folds for some in self.stream(fold))
        facts = {
            "files": {file.name: hash_file(file) for file in predictions.files},
            "rows": len(predictions.rows),
            "exactly": len(predictions.exactly),
        }
        name = path.stem if path.is_file() else resolve_links(path).name
        return name, align(predictions, masked, classes, elsewhere=self._list_elsewhere()), facts

    def open_entry(self, path: Path) -> PredictionWriter:
        """Open a writer of a run's expectations."""
        classes = self.data.manifest.class_space.classes
        return PredictionWriter(path, classes, masks_sha256=self.masks_sha256)

    def _list_elsewhere(self) -> set[str]:
        """Return the scenes of the folds that are not measured."""
        if self.folds == (None,):
            return set()
        data = self.data
        measured = {s for fold in self.folds for s in scenes_of(data, self.split, fold=fold)}
        return {scene for some in data.splits.values() for scene in some} - measured

    def _survey(self, fold: int | None) -> pd.DataFrame:
        frames = []
        for masked in self.stream(fold):
            truth, starts = read_truth(masked), masked.seen.starts
            columns = {
                "scene_id": masked.seen.scene_ids,
                "objects": truth.targets[starts[:-1]].sum(axis=1),
                "rooms": np.diff(starts) - 1,
            }
            for name, counts in (("empty_inputs", truth.inputs), ("empty_targets", truth.targets)):
                columns[name] = np.add.reduceat((~counts.any(axis=1)).astype(int), starts[:-1])
            frames.append(pd.DataFrame(columns))
        if not frames:  # buildings with too many objects have no pairs
            raise DatasetError(
                f"{self.data.path}: no building of the split {self.split!r} has pairs"
            )
        return pd.concat(frames, ignore_index=True)


def _expect(model: BeliefModel | AlignedPredictions, masked: MaskedBuildings) -> Expectation:
    return predict_all(model, masked) if isinstance(model, BeliefModel) else model.expect(masked)


def name_entry(name: str, fold: int | None) -> str:
    """Return the file of a run's expectations; those of all folds are one entry, a folder."""
    return f"{stem_of(name)}.parquet" if fold is None else f"{stem_of(name)}/fold-{fold}.parquet"
