"""Measure each model of a leaderboard on the buildings that it was not trained on.

`NAME@MASK` names a model by its configuration and the mask of its training; its runs are
`BOARD/MASK/fold-K/NAME`. If several seeds trained it, these are the runs of the first, which is
enough here. A tally says what each node adds to some means; means are over nodes or cells, and
buildings can be resampled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import MaskedBuildings, stream_sampled
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Bootstrap, weigh_buildings
from bsg_models.evaluation.measurement import predict_all, read_truth
from bsg_models.evaluation.metric_rows import hidden_nll
from bsg_models.evaluation.truth import Truth
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.studies.leaderboard import DATASET, run_of
from bsg_models.zoo.model import BeliefModel, one_thread

# Name → what each node adds to the sum, `[N]`, and its number of cells, `[N]`.
Shares = Mapping[str, tuple[Floats, Floats]]
Tally = Callable[[Truth, MaskedBuildings, Expectation], Shares]
READS = "reads labels"  # column of tables whose models are not all told the same


@dataclass(frozen=True, eq=False)
class FoldModel:
    """A model, and the scenes of the fold that it was trained without."""

    fold: int
    data: Dataset
    model: BeliefModel
    scenes: tuple[str, ...]
    run: Path

    def stream(self, mask: MaskRecipe, *, draws: int) -> Iterator[MaskedBuildings]:
        """Yield masks 0 to `draws` - 1 of every building of the fold, in batches."""
        for draw in range(draws):
            yield from stream_sampled(
                self.data, self.scenes, mask=mask, draw=draw, vocabulary=self.model.vocabulary
            )


def bootstrap(batches: Iterable[tuple[int, Sequence[str], Shares]], *, resamples: int) -> Bootstrap:
    """Return the means over batches of (fold, scene of each node `[N]`, shares).

    The cells of all folds are pooled.

    >>> shares = {"x": (np.array([1.0, 3.0, 5.0]), np.array([1.0, 1.0, 2.0]))}
    >>> bootstrap([(0, ("a", "a", "b"), shares)], resamples=0).point
    {'x': 2.25}
    """
    frames = []
    for fold, scenes, shares in batches:
        index = pd.MultiIndex.from_product([[fold], scenes], names=["fold", "scene"])
        parts = {(name, part): both[part] for name, both in shares.items() for part in (0, 1)}
        frames.append(pd.DataFrame(parts, index=index).groupby(level=["fold", "scene"]).sum())
    joined = pd.concat(frames).groupby(level=["fold", "scene"]).sum().sort_index(level="scene")
    weights = weigh_buildings(len(joined), resamples=resamples, seed=0)
    sums, cells = (joined.xs(part, axis=1, level=1).T @ weights for part in (0, 1))
    found = sums / cells
    return Bootstrap(
        point={str(name): float(value) for name, value in found[0].items()},
        resampled={str(name): row.to_numpy()[1:] for name, row in found.iterrows()},
        nodes={str(name): int(joined[name, 1].sum()) for name in found.index},
    )


def list_models(board: Path, masks: Sequence[str] | None = None) -> list[str]:
    """Return the names `NAME@MASK` of all models of a leaderboard, trained under some masks."""
    found = [
        f"{path.parent.name}@{path.parents[2].name}"
        for path in sorted(board.glob(f"*/fold-0/*/{BEST}"))
        if masks is None or path.parents[2].name in masks
    ]
    if not found:
        raise DatasetError(
            f"{board}: expected the folder of a leaderboard, MASK/fold-K/NAME/{BEST}, found no "
            "model; run `bsg-leaderboard` first",
            code="leaderboard-empty",
            where=board,
        )
    return found


def open_dataset(board: Path, name: str) -> Dataset:
    """Return the dataset in folds that the runs of `NAME@MASK` were trained on."""
    there = board / name.partition("@")[2] / DATASET
    # Masks without stored pairs of their own share a dataset: all have the same folds.
    return Dataset.open(there if there.is_dir() else sorted(board.glob(f"*/{DATASET}"))[0])


def open_folds(board: Path, name: str, folds: Sequence[int] | None = None) -> Iterator[FoldModel]:
    """Yield the model of some folds of `NAME@MASK`, or of all, trained by the first seed."""
    data = open_dataset(board, name)
    model, _, mask = name.partition("@")
    for fold in range(len(data.splits)) if folds is None else folds:
        run = run_of(board / mask, model, fold)
        restored = restore_model(run / BEST, load_checkpoint(run / BEST))
        yield FoldModel(fold, data, restored, scenes_of(data, "test", fold=fold), run)


def say_reads(board: Path, name: str, folds: Sequence[int] | None = None) -> str:
    """Say for the column `READS` whether the settings of `NAME@MASK` let it read room labels."""
    return "yes" if next(open_folds(board, name, folds)).model.reads_labels else "–"


def mask_of(data: Dataset, strategy: str) -> MaskRecipe:
    """Return a mask with fraction and seed of a leaderboard's dataset; no class is withheld."""
    base = MaskRecipe() if data.manifest.pairs is None else data.manifest.pairs.mask
    return MaskRecipe(strategy=strategy, fraction=base.fraction, seed=base.seed)


def measure(
    models: Iterable[FoldModel],
    tally: Tally,
    *,
    mask: MaskRecipe,
    draws: int,
    resamples: int,
    without: Sequence[str] = (),
) -> Bootstrap:
    """Return means over the buildings of several folds, each predicted by its own model.

    Args:
        models: of different buildings.
        tally: what each node adds.
        mask: that the buildings are tested under.
        draws: masks of every building.
        resamples: of the buildings.
        without: evidence that is withheld from the models; the tally receives it.
    """

    def batches() -> Iterator[tuple[int, Sequence[str], Shares]]:
        for one in models:
            for masked in one.stream(mask, draws=draws):
                truth = read_truth(masked)
                told = replace(masked, seen=masked.seen.without(*without)) if without else masked
                scenes = np.array(truth.scene_ids)[truth.building]
                yield one.fold, scenes, tally(truth, masked, predict_all(one.model, told))

    with one_thread():
        return bootstrap(batches(), resamples=resamples)


def tally_likelihood(truth: Truth, masked: MaskedBuildings, found: Expectation) -> Shares:
    """Return `nll`: −log P(hidden counts), over the classes of every room."""
    rooms = (~truth.is_building).astype(float)
    return {"nll": (hidden_nll(truth, found) * rooms, rooms)}


def tally_unvisited(truth: Truth, masked: MaskedBuildings, found: Expectation) -> Shares:
    """Return `nll`, `said` and `true` objects, and `gap`, over rooms of which nothing was seen."""
    seen = masked.seen
    rooms = (~seen.is_building & (seen.hidden_share == 1)).astype(float)
    said, true = found.hidden.sum(axis=1, where=truth.known), truth.hidden.sum(axis=1)
    gap = (found.presence - (truth.hidden > 0)).mean(axis=1, where=truth.known)
    values = {"nll": hidden_nll(truth, found), "said": said, "true": true, "gap": gap}
    return {name: (value * rooms, rooms) for name, value in values.items()}
