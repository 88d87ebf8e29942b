"""Train by gradient, epoch by epoch, on masked graphs (paper, section IV-A).

The order and dropout of an epoch depend only on (seed, epoch), and its masks on (the mask's own
seed, epoch). So a stopped run continues to the same weights as one that was not stopped.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from bsg_data.dataset.dataset import Dataset
from bsg_data.files import write_bytes
from bsg_models.errors import TrainingError
from bsg_models.inputs.nodes import Nodes
from bsg_models.runs.checkpoint import (
    CheckpointHeader,
    load_checkpoint,
    make_header,
    name_tensors,
    read_header,
    save_checkpoint,
)
from bsg_models.runs.run_folder import BEST, LAST, METRICS
from bsg_models.training.buildings import TrainingBuildings, epoch_seed
from bsg_models.training.learning_curve import EpochReport, encode_metrics, read_metrics
from bsg_models.training.optimiser import (
    learning_rate,
    load_optimiser,
    make_optimiser,
    optimiser_state,
)
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.network import Network
from bsg_models.zoo.settings import Device


class GradientSteps:
    """The steps of a training, on a device.

    Args:
        model: that is trained; it is moved to the device.
        config: of the run.
        device: of the steps.
    """

    def __init__(self, model: Network, config: RunConfig, *, device: torch.device) -> None:
        self.model = model.to(device)
        self.optimiser = make_optimiser(model, config.training)
        self._config, self._device = config, device

    def train_epoch(self, buildings: TrainingBuildings, epoch: int) -> float:
        """Take the steps of an epoch; return the mean of their losses."""
        training = self._config.training
        torch.manual_seed(epoch_seed(self._config, epoch))  # of dropout
        steps = buildings.steps
        self.model.train()
        losses = []
        for step, some in enumerate(buildings.batches(epoch), (epoch - 1) * steps):
            nodes = self.model.nodes_of(some.seen, some.targets).to(self._device)
            for group in self.optimiser.param_groups:
                group["lr"] = learning_rate(training, step, steps=steps * training.epochs)
            self.optimiser.zero_grad()
            loss = self.model.loss(nodes)
            loss.backward()  # type: ignore[no-untyped-call]
            if training.clip is not None:
                nn.utils.clip_grad_norm_(self.model.parameters(), training.clip)
            self.optimiser.step()
            losses.append(loss.detach())
        return float(np.mean(torch.stack(losses).cpu().numpy().astype(np.float64)))

    def on_cpu(self) -> Network:
        """Return the model on the CPU, for validation or saving."""
        return self.model if self._device.type == "cpu" else copy.deepcopy(self.model).cpu()


def find_device(wanted: Device) -> torch.device:
    """Return the device of a training.

    Args:
        wanted: `auto` for a GPU if there is one.
    """
    there = torch.cuda.is_available()
    if wanted == "cuda" and not there:
        raise TrainingError(
            "training.device is cuda, but torch finds no GPU here; use `--set training.device=cpu`"
            ", or install a torch that is built for this machine's GPU"
        )
    return torch.device("cuda" if there and wanted != "cpu" else "cpu")


def train_epochs(
    steps: GradientSteps,
    config: RunConfig,
    data: Dataset,
    run: Path,
    buildings: TrainingBuildings,
    validation: Sequence[Nodes],
) -> Iterator[EpochReport]:
    """Train a model from its last checkpoint, or from the start, into the folder of a run.

    Args:
        steps: of a new model, or of any weights if the run has a last checkpoint.
        config: of the run.
        data: an open dataset.
        run: folder, whose lock the caller holds; its content passed `require_same_training`.
        buildings: of every epoch.
        validation: batches of masked buildings that the training does not see.

    Yields:
        One report per epoch.
    """
    training = config.training
    rows = _restore(steps, run) if (run / LAST).exists() else []
    losses = ((row.val_loss, row.epoch) for row in rows if row.val_loss is not None)
    best = min(losses, default=(float("inf"), 0))
    for epoch in range(len(rows) + 1, training.epochs + 1):
        began = time.perf_counter()
        train_loss, val_loss = steps.train_epoch(buildings, epoch), None
        if epoch % training.validate_every == 0 or epoch == training.epochs:
            val_loss = _validate(steps.on_cpu(), validation)
        if not np.isfinite([train_loss, val_loss or 0.0]).all():
            raise TrainingError(
                f"{run}: the loss of epoch {epoch} is not finite (training {train_loss}, "
                f"validation {val_loss}); lower training.learning_rate. "
                "The saved checkpoints are of earlier epochs"
            )
        if val_loss is not None:
            best = min(best, (val_loss, epoch))
        report = EpochReport(
            epoch=epoch,
            epochs=training.epochs,
            train_loss=train_loss,
            val_loss=val_loss,
            best_epoch=best[1],
            seconds=time.perf_counter() - began,
        )
        rows.append(report)
        if val_loss is not None:
            header = make_header(
                config,
                data,
                vocabulary=steps.model.vocabulary,
                epoch=epoch,
                val_loss=val_loss,
                best_epoch=best[1],
                best_loss=best[0],
            )
            _save(steps, header, rows, run)
        yield report


def _validate(model: Network, validation: Sequence[Nodes]) -> float:
    """Return a model's loss per (node, class) cell."""
    parts = [model.validation_loss(some) for some in validation]
    return sum(total for total, _ in parts) / max(sum(cells for _, cells in parts), 1)


def _save(
    steps: GradientSteps, header: CheckpointHeader, rows: list[EpochReport], run: Path
) -> None:
    """Write the metrics, the last checkpoint, and the best one if this epoch is the best."""
    write_bytes(run / METRICS, encode_metrics(rows))
    state = name_tensors("model", steps.on_cpu().state())
    if header.epoch == header.best_epoch:
        save_checkpoint(run / BEST, header, state)
    adam = name_tensors("adam", optimiser_state(steps.optimiser, steps.model))
    save_checkpoint(run / LAST, header, {**state, **adam})


def _restore(steps: GradientSteps, run: Path) -> list[EpochReport]:
    """Restore model and optimiser from the last checkpoint; return the reports up to it."""
    checkpoint = load_checkpoint(run / LAST)
    epochs = checkpoint.header.epoch
    rows = [row for row in read_metrics(run / METRICS) if row.epoch <= epochs]
    if not (run / BEST).is_file() or len(rows) < epochs:
        gone = METRICS if (run / BEST).is_file() else BEST
        raise TrainingError(f"{run / gone}: is gone, or a part of it; --force starts the run again")
    steps.model.load_state(checkpoint.state_of("model"))
    load_optimiser(steps.optimiser, steps.model, checkpoint.state_of("adam"))
    return rows


def require_same_training(config: RunConfig, data: Dataset, path: Path) -> None:
    """Refuse to continue a run of another dataset or configuration; epochs and device may differ.

    Args:
        config: of the run.
        data: an open dataset.
        path: of the checkpoint to continue from, which may be missing.
    """
    if not path.exists():
        return
    header = read_header(path)
    if header.dataset_sha256 != data.sha256:
        raise TrainingError(
            f"{path}: was trained on another dataset (manifest {header.dataset_sha256[:12]}…, "
            f"this one {data.sha256[:12]}…); resume with the same one, or start a new run"
        )
    if config.training.schedule == "one-cycle" and header.config.training.epochs != (
        config.training.epochs
    ):
        raise TrainingError(
            f"{path}: its learning rate falls over {header.config.training.epochs} epochs "
            "(training.schedule one-cycle), so it cannot be made longer; --force starts again"
        )
    theirs = header.config.training
    aside = {"epochs": theirs.epochs, "device": theirs.device}
    same = config.model_copy(update={"training": config.training.model_copy(update=aside)})
    if header.config != same:
        differing = ", ".join(_differences(header.config.model_dump(), same.model_dump()))
        raise TrainingError(
            f"{path}: was trained with another configuration ({differing}); only training.epochs "
            "and training.device may change. Choose another --out, or --force"
        )


def _differences(old: dict[str, Any], new: dict[str, Any], path: str = "") -> Iterator[str]:
    """Yield `path: old → new` for every value that differs."""
    for key in old.keys() | new.keys():
        a, b = old.get(key), new.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differences(a, b, f"{path}{key}.")
        elif a != b:
            yield f"{path}{key}: {a} → {b}"
