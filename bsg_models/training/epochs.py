"""Training by gradient, epoch by epoch, on masked graphs (paper, section IV-A).

The order and the dropout of an epoch are drawn from (seed, epoch) alone, its masks from (the mask's
own seed, epoch): they do not depend on the epochs before it having run in this process. A run that
was stopped therefore goes on to the same weights as one that was not.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.utils.data import DataLoader
from torch_geometric.data import Data

from bsg_data.dataset.dataset import Dataset
from bsg_data.files import write_bytes
from bsg_data.observation.masked_buildings import (
    MaskedBuildings,
    sample_masked,
    stack_masked,
    stream_sampled,
)
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import read_split, stream_split
from bsg_models.runs.checkpoint import (
    CheckpointHeader,
    load_checkpoint,
    read_header,
    restore_model,
    save_checkpoint,
)
from bsg_models.runs.run_folder import BEST, LAST, METRICS, make_header, name_tensors
from bsg_models.training.learning_curve import EpochReport, encode_metrics, read_metrics
from bsg_models.training.optimiser import (
    learning_rate,
    load_optimiser,
    make_optimiser,
    optimiser_state,
)
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import BeliefModel, Network
from bsg_models.zoo.settings import TrainingConfig

_VAL_BATCH = 256  # buildings
_VAL_DRAWS = 10  # of every val building, where the stored pairs are not what is trained for


class TrainingBuildings:
    """The masked buildings of every epoch of one training, from a dataset that was opened once."""

    def __init__(self, config: RunConfig, data: Dataset, model: BeliefModel) -> None:
        self._data, self._choice, self._vocabulary = data, config.data, model.vocabulary
        self.val = validation_buildings(config, data, vocabulary=model.vocabulary)
        self._scenes = scenes_of(data, "train", fold=config.data.fold)
        self._fixed = (
            read_split(data, "train", fold=config.data.fold, vocabulary=model.vocabulary)
            if config.data.masks == "fixed"
            else None
        )

    def steps_of(self, training: TrainingConfig) -> int:
        """Return the number of steps of an epoch."""
        number = len(self._scenes) if self._fixed is None else len(self._fixed)
        return -(-number // training.batch_size)

    def of_epoch(self, epoch: int) -> MaskedBuildings:
        """Return the stored pairs, or mask number `epoch` of every training building."""
        if self._fixed is not None:
            return self._fixed
        return sample_masked(
            self._data,
            self._scenes,
            mask=self._choice.fresh_mask,
            draw=epoch,
            fractions=self._choice.fractions,
            vocabulary=self._vocabulary,
        )


def stream_validation(
    config: RunConfig, data: Dataset, *, vocabulary: tuple[str, ...]
) -> Iterator[MaskedBuildings]:
    """Yield val under masks of the kind that is trained on: stored pairs, or ten fresh masks.

    Some buildings at a time, so that no more of them are held, however many there are.

    Args:
        config: of the run.
        data: an open dataset.
        vocabulary: categories outside the classes that are looked for.

    Raises:
        DatasetError: if stored pairs are needed, and there are none.
    """
    choice, pairs = config.data, data.manifest.pairs
    if not choice.needs_own_masks(pairs.mask if pairs else None):
        yield from stream_split(data, "val", fold=choice.fold, vocabulary=vocabulary)
        return
    scenes = scenes_of(data, "val", fold=choice.fold)
    for draw in range(_VAL_DRAWS):
        yield from stream_sampled(
            data,
            scenes,
            mask=choice.fresh_mask,
            draw=draw,
            fractions=choice.fractions,
            vocabulary=vocabulary,
        )


def validation_buildings(
    config: RunConfig, data: Dataset, *, vocabulary: tuple[str, ...]
) -> MaskedBuildings:
    """Return all that `stream_validation` yields, as one.

    Raises:
        DatasetError: if stored pairs are needed, and there are none.
    """
    return stack_masked(list(stream_validation(config, data, vocabulary=vocabulary)))


def train_epochs(
    model: Network, config: RunConfig, data: Dataset, run: Path, buildings: TrainingBuildings
) -> Iterator[EpochReport]:
    """Train a model from its last checkpoint, or from the start, into the folder of a run.

    Args:
        model: new, or of any weights if the run has a last checkpoint.
        config: of the run.
        data: an open dataset.
        run: folder, which the caller holds; what it has is of `require_same_training`.
        buildings: of every epoch.

    Yields:
        one report an epoch.

    Raises:
        TrainingError: if the loss is not finite, or the run lost a part.
    """
    training = config.training
    optimiser = make_optimiser(model, training)
    start, best_epoch, best_loss = 0, 0, float("inf")
    rows: list[EpochReport] = []
    if (run / LAST).exists():
        header = _restore(model, optimiser, run)
        start, best_epoch, best_loss = header.epoch, header.best_epoch, header.best_loss or 0.0
        rows = [row for row in read_metrics(run / METRICS) if row.epoch <= start]
    for epoch in range(start + 1, training.epochs + 1):
        began = time.perf_counter()
        train_loss = _train_epoch(model, optimiser, config, buildings, epoch=epoch)
        val_loss = None
        if epoch % training.validate_every == 0 or epoch == training.epochs:
            val_loss = validation_loss(model, buildings.val)
        if not np.isfinite([train_loss, val_loss or 0.0]).all():
            raise TrainingError(
                f"{run}: the loss of epoch {epoch} is not finite (training {train_loss}, "
                f"validation {val_loss}); lower training.learning_rate. "
                "What was saved is of earlier epochs"
            )
        is_best = val_loss is not None and val_loss < best_loss
        if val_loss is not None and is_best:
            best_epoch, best_loss = epoch, val_loss
        report = EpochReport(
            epoch=epoch,
            epochs=training.epochs,
            train_loss=train_loss,
            val_loss=val_loss,
            best_epoch=best_epoch,
            seconds=time.perf_counter() - began,
        )
        rows.append(report)
        if val_loss is not None:
            header = make_header(
                config,
                data,
                vocabulary=model.vocabulary,
                epoch=epoch,
                val_loss=val_loss,
                best_epoch=best_epoch,
                best_loss=best_loss,
            )
            state = name_tensors("model", model.state_dict())
            write_bytes(run / METRICS, encode_metrics(rows))
            if is_best:
                save_checkpoint(run / BEST, header, state)
            adam = name_tensors("adam", optimiser_state(optimiser, model))
            save_checkpoint(run / LAST, header, {**state, **adam})
        yield report


def _restore(model: Network, optimiser: torch.optim.Optimizer, run: Path) -> CheckpointHeader:
    checkpoint = load_checkpoint(run / LAST)
    if not (run / BEST).is_file():
        raise TrainingError(f"{run / BEST}: is gone; --force starts the run again")
    if checkpoint.header.vocabulary != model.vocabulary:
        raise TrainingError(f"{run / LAST}: reads other categories; --force starts the run again")
    model.load_state_dict(restore_model(run / LAST, checkpoint).state_dict())
    load_optimiser(optimiser, model, checkpoint.state_of("adam"), path=run / LAST)
    return checkpoint.header


def load_graphs(
    model: Network,
    masked: MaskedBuildings,
    *,
    batch_size: int,
    generator: torch.Generator | None = None,
) -> DataLoader[Data]:
    """Return masked buildings batch by batch, in random order if a generator is given."""

    def batch(numbers: list[int]) -> Data:
        some = masked.take(numbers)
        return model.graph_of(some.seen, some.targets)

    return DataLoader(
        range(len(masked)),  # type: ignore[arg-type] # what a batch is made of are numbers
        batch_size=batch_size,
        shuffle=generator is not None,
        generator=generator,
        collate_fn=batch,
    )


def validation_loss(model: Network, masked: MaskedBuildings) -> float:
    """Return a model's validation loss per cell (node, class)."""
    batches = load_graphs(model, masked, batch_size=_VAL_BATCH)
    parts = [model.validation_loss(batch) for batch in batches]
    return sum(total for total, _ in parts) / max(sum(cells for _, cells in parts), 1)


def _train_epoch(
    model: Network,
    optimiser: torch.optim.Optimizer,
    config: RunConfig,
    buildings: TrainingBuildings,
    *,
    epoch: int,
) -> float:
    training = config.training
    seed = int(np.random.SeedSequence([config.seed, epoch]).generate_state(1)[0])
    torch.manual_seed(seed)  # of dropout
    order = torch.Generator().manual_seed(seed)
    loader = load_graphs(
        model, buildings.of_epoch(epoch), batch_size=training.batch_size, generator=order
    )
    steps = buildings.steps_of(training)
    losses = []
    for step, batch in enumerate(loader, start=(epoch - 1) * steps):
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(training, step, steps=steps * training.epochs)
        model.train()
        optimiser.zero_grad()
        loss = model.loss(batch)
        loss.backward()  # type: ignore[no-untyped-call]
        if training.clip is not None:
            torch.nn.utils.clip_grad_norm_(model.parameters(), training.clip)
        optimiser.step()
        losses.append(loss.item())
    return float(np.mean(losses))


def require_same_training(config: RunConfig, data: Dataset, run: Path) -> None:
    """Refuse to go on with a run of another dataset or configuration; only its epochs may differ.

    Raises:
        TrainingError: naming what differs.
        CheckpointError: if the last checkpoint is damaged.
    """
    path = run / LAST
    if not path.exists():
        return
    header = read_header(path)
    if header.dataset_sha256 != data.sha256:
        raise TrainingError(
            f"{path}: was trained on another dataset (manifest {header.dataset_sha256[:12]}…, "
            f"this one {data.sha256[:12]}…); resume with the same, or start a new run"
        )
    if config.training.schedule == "one-cycle" and header.config.training.epochs != (
        config.training.epochs
    ):
        raise TrainingError(
            f"{path}: its learning rate falls over {header.config.training.epochs} epochs "
            "(training.schedule one-cycle), so that it cannot be made longer; --force starts again"
        )
    same = config.model_copy(
        update={
            "training": config.training.model_copy(update={"epochs": header.config.training.epochs})
        }
    )
    if header.config != same:
        differing = ", ".join(_differences(header.config.model_dump(), same.model_dump()))
        raise TrainingError(
            f"{path}: was trained with another configuration ({differing}); only training.epochs "
            "may change. Choose another --out, or --force"
        )


def _differences(old: dict[str, Any], new: dict[str, Any], path: str = "") -> Iterator[str]:
    """Yield `path: old → new` of every value that differs."""
    for key in old.keys() | new.keys():
        a, b = old.get(key), new.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differences(a, b, f"{path}{key}.")
        elif a != b:
            yield f"{path}{key}: {a} → {b}"
