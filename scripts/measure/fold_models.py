"""Open the trained models of a leaderboard, each with the fold that it was not trained on.

`NAME@MASK` names a model by its configuration and the mask of its training. Its runs are
`OUT/MASK/fold-K/NAME`, K from 0.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from building_means import (
    BuildingMeans,
    add_buildings,
    join_buildings,
    sum_buildings,
)
from tallies import Tally

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import encode_manifest
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import MaskedBuildings, stack_masked, stream_sampled
from bsg_data.recipes import MaskRecipe
from bsg_models.evaluation.bootstrap import Bootstrap, bootstrap
from bsg_models.evaluation.measurement import predict_all, read_truth
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST
from bsg_models.studies.leaderboard import DATASET
from bsg_models.studies.leaderboard_runs import run_of
from bsg_models.zoo.model import BeliefModel
from bsg_models.zoo.threads import one_thread


@dataclass(frozen=True, eq=False)
class FoldModel:
    """A model and the fold that it is tested on.

    Attributes:
        name: `NAME@MASK`.
        fold: its number.
        data: the dataset in folds.
        model: trained without the fold.
        scenes: of the fold.
        run: folder of the model.
    """

    name: str
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

    def sample(self, mask: MaskRecipe, *, draws: int) -> MaskedBuildings:
        """Return masks 0 to `draws` - 1 of every building of the fold."""
        return stack_masked(list(self.stream(mask, draws=draws)))


def list_models(board: Path, masks: Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the names `NAME@MASK` of all models of a leaderboard that have every fold.

    Args:
        board: folder of the leaderboard.
        masks: masks of the trainings; None for all.

    Raises:
        DatasetError: if there is no such model.
    """
    found = []
    for folder in sorted({path.parent for path in board.glob("*/fold-0")}):
        if masks is not None and folder.name not in masks:
            continue
        finished = sorted({path.parent.name for path in folder.glob(f"fold-*/*/{BEST}")})
        folds = len(open_dataset(board, f"any@{folder.name}").splits)
        found += [
            f"{name}@{folder.name}"
            for name in finished
            if all((run_of(folder, name, fold) / BEST).is_file() for fold in range(folds))
        ]
    if not found:
        raise DatasetError(
            f"{board}: expected the folder of a leaderboard, MASK/{DATASET} and "
            f"MASK/fold-K/NAME/{BEST}, found no model with all folds; run `bsg-leaderboard` first"
        )
    return tuple(found)


def open_dataset(board: Path, name: str) -> Dataset:
    """Return the dataset in folds that the runs of `NAME@MASK` were trained on.

    Raises:
        DatasetError: if the name has another form, or the leaderboard lacks the mask.
    """
    model, _, mask = name.partition("@")
    if not model or not mask or "/" in name:
        raise DatasetError(f"{name!r}: expected NAME@MASK, as in ceci-sage@uniform")
    there = board / mask / DATASET
    if (board / mask / "fold-0").is_dir() and not there.is_dir():
        there = next(iter(sorted(board.glob(f"*/{DATASET}"))), there)  # all have the same folds
    if not there.is_dir():
        known = ", ".join(sorted(path.parent.name for path in board.glob(f"*/{DATASET}")))
        raise DatasetError(f"{board}: has no models of mask {mask!r}; it has {known or 'none'}")
    return Dataset.open(there)


def open_folds(board: Path, name: str) -> Iterator[FoldModel]:
    """Yield the model of every fold of `NAME@MASK`.

    Raises:
        DatasetError: if there is no such run.
        CheckpointError: if a checkpoint is damaged.
    """
    data = open_dataset(board, name)
    model_name, _, mask = name.partition("@")
    for fold in range(len(data.splits)):
        run = run_of(board / mask, model_name, fold)
        if not (run / BEST).is_file():
            raise DatasetError(f"{run}: expected a trained run ({BEST}), found none; train it")
        checkpoint = load_checkpoint(run / BEST)
        yield FoldModel(
            name=name,
            fold=fold,
            data=data,
            model=restore_model(run / BEST, checkpoint),
            scenes=scenes_of(data, "test", fold=fold),
            run=run,
        )


def mask_of(board: Path, name: str, strategy: str) -> MaskRecipe:
    """Return the recipe by which a leaderboard would test a model on a kind of mask.

    Fraction and seed are the leaderboard's; no class is withheld.
    """
    pairs = open_dataset(board, name).manifest.pairs
    base = MaskRecipe() if pairs is None else pairs.mask
    return MaskRecipe(strategy=strategy, fraction=base.fraction, seed=base.seed)


def measure_models(
    models: Iterable[FoldModel],
    tally: Tally,
    *,
    mask: MaskRecipe,
    draws: int,
    by_fold: bool = False,
    without: Sequence[str] = (),
) -> BuildingMeans:
    """Return means over the buildings of several folds, each predicted by its own model.

    Args:
        models: of different buildings, as `open_folds` yields them.
        tally: what each node adds.
        mask: that the buildings are tested under.
        draws: masks of every building.
        by_fold: whether a value is the mean over the folds.
        without: evidence withheld from the models, any of `EVIDENCE` of the surroundings; the tally
            still receives it.
    """
    parts = []
    with one_thread():
        for one in models:
            batches = []
            for masked in one.stream(mask, draws=draws):
                truth = read_truth(masked)
                told = replace(masked, seen=masked.seen.without(*without)) if without else masked
                shares = tally(truth, masked, predict_all(one.model, told))
                batches.append(sum_buildings(truth.scene_ids, truth.building, shares))
            parts.append(add_buildings(batches))
    return join_buildings(parts, by_fold=by_fold)


def measure_masks(
    board: Path,
    name: str,
    tally: Tally,
    *,
    masks: Sequence[str],
    draws: int,
    resamples: int,
    by_fold: bool = True,
) -> dict[str, Bootstrap]:
    """Return means of `NAME@MASK` under several kinds of mask, all on the same resamples."""
    return {
        mask: bootstrap(
            measure_models(
                open_folds(board, name),
                tally,
                mask=mask_of(board, name, mask),
                draws=draws,
                by_fold=by_fold,
            ),
            resamples=resamples,
        )
        for mask in masks
    }


def hash_unsplit(data: Dataset) -> str:
    """Return the sha256 of a dataset's manifest before the split, which identifies its content.

    The seal is left out, so that the hash equals that of versions without seals.
    """
    return hashlib.sha256(encode_manifest(data.manifest.without_split())).hexdigest()
