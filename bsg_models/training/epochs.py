"""Train by gradient, epoch by epoch, on masked graphs (paper, section IV-A).

The order and dropout of an epoch depend only on (seed, epoch), and its masks on (the mask's own
seed, epoch). So a training that was stopped goes on to the same weights as one that was not.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import TypeAdapter
from torch import nn

from bsg_data.dataset.dataset import Dataset
from bsg_data.files import write_bytes
from bsg_data.observation.masked_buildings import BATCH
from bsg_models.errors import TrainingError
from bsg_models.runs.checkpoint import (
    load_checkpoint,
    make_header,
    name_tensors,
    save_checkpoint,
)
from bsg_models.runs.run_folder import EpochReport, encode_metrics
from bsg_models.training.buildings import TrainingBatches, validation_buildings
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import State
from bsg_models.zoo.settings import Device, TrainingConfig
from bsg_models.zoo.torch_module import TorchModule

Progress = Callable[[EpochReport], None]
SECONDS_BETWEEN_SAVES = 5.0  # a save to disk takes as long as an epoch or two
_REPORTS = TypeAdapter(list[EpochReport])


@dataclass(eq=False)
class _Done:
    """What a training has done so far, besides its weights and the optimiser."""

    reports: list[EpochReport] = field(default_factory=list)
    best: State = field(default_factory=dict)  # the weights of the lowest validation loss

    @property
    def lowest(self) -> tuple[float, int]:
        """The lowest validation loss, and its epoch."""
        epoch = self.reports[-1].best_epoch if self.reports else 0
        loss = self.reports[epoch - 1].val_loss if epoch else None
        return (float("inf"), 0) if loss is None else (loss, epoch)

    def add(self, *, epochs: int, train_loss: float, val_loss: float | None, began: float) -> bool:
        """Add an epoch; return whether it is the best so far."""
        epoch, best = len(self.reports) + 1, self.lowest
        if val_loss is not None:
            best = min(best, (val_loss, epoch))
        report = EpochReport(
            epoch=epoch,
            epochs=epochs,
            train_loss=train_loss,
            val_loss=val_loss,
            best_epoch=best[1],
            seconds=time.perf_counter() - began,
        )
        self.reports.append(report)
        return report.best_epoch == epoch

    def waited(self, patience: int | None) -> bool:
        """Return whether so many validations were no better than the best; None waits for ever."""
        later = self.reports[self.lowest[1] :]
        return patience is not None and sum(r.val_loss is not None for r in later) >= patience


class _GradientSteps:
    """The steps of a training, on a device.

    Args:
        model: that is trained; it is moved to the device.
        config: of the run.
        device: of the steps.
    """

    def __init__(self, model: TorchModule, config: RunConfig, *, device: torch.device) -> None:
        self.model = model.to(device)
        self.optimiser = _make_optimiser(model, config.training)
        self._config, self._device = config, device

    def train_epoch(self, batches: TrainingBatches, epoch: int) -> float:
        """Take the steps of an epoch; return the mean of their losses."""
        training, steps = self._config.training, batches.steps
        torch.manual_seed(self._config.seed_of(epoch))  # of dropout
        self.model.train()
        losses = []
        for step, batch in enumerate(batches.of(epoch), (epoch - 1) * steps):
            for group in self.optimiser.param_groups:
                group["lr"] = learning_rate(training, step, steps=steps * training.epochs)
            self.optimiser.zero_grad()
            loss = self.model.loss(batch.to(self._device))
            loss.backward()  # type: ignore[no-untyped-call]
            if training.clip is not None:
                nn.utils.clip_grad_norm_(self.model.parameters(), training.clip)
            self.optimiser.step()
            losses.append(loss.detach())
        return float(np.mean(torch.stack(losses).cpu().numpy().astype(np.float64)))

    def on_cpu(self) -> TorchModule:
        """Return the model on the CPU, for validation or saving."""
        return self.model if self._device.type == "cpu" else copy.deepcopy(self.model).cpu()

    def save(self, path: Path, data: Dataset, done: _Done) -> None:
        """Write all that the training needs to go on."""
        vocabulary, epoch = self.model.vocabulary, len(done.reports)
        header = make_header(self._config, data, vocabulary=vocabulary, epoch=epoch)
        tensors = {
            **name_tensors("model", self.on_cpu().state()),
            **name_tensors("adam", _optimiser_state(self.optimiser, self.model)),
            **name_tensors("best", done.best),
            "reports": np.frombuffer(_REPORTS.dump_json(done.reports), dtype=np.uint8),
        }
        save_checkpoint(path, header, tensors)

    def restore(self, path: Path, data: Dataset) -> _Done:
        """Go on with what was saved, if it is of this training.

        Raises:
            CheckpointError: if the file is damaged.
        """
        checkpoint = load_checkpoint(path) if path.exists() else None
        if (
            checkpoint is None
            or not checkpoint.header.is_of(self._config, data)
            or "reports" not in checkpoint.tensors
        ):
            return _Done()
        self.model.load_state(checkpoint.state_of("model"))
        _load_optimiser(self.optimiser, self.model, checkpoint.state_of("adam"))
        reports = _REPORTS.validate_json(checkpoint.tensors["reports"].tobytes())
        return _Done(reports, checkpoint.state_of("best"))


def find_device(wanted: Device) -> torch.device:
    """Return the device of a training.

    Args:
        wanted: `auto` for a GPU if there is one.
    """
    has_gpu = torch.cuda.is_available()
    if wanted == "cuda" and not has_gpu:
        raise TrainingError(
            "training.device is cuda, but torch finds no GPU here; use `--set training.device=cpu`"
            ", or install a torch that is built for this machine's GPU"
        )
    return torch.device("cuda" if has_gpu and wanted != "cpu" else "cpu")


def train_network(
    network: TorchModule,
    config: RunConfig,
    data: Dataset,
    *,
    unfinished: Path,
    metrics: Path,
    progress: Progress,
) -> tuple[State, list[EpochReport]]:
    """Train a network from its start, or from where it was stopped.

    Args:
        network: a new one.
        config: of the run.
        data: an open dataset.
        unfinished: the checkpoint that validations write, some seconds apart, and that a stopped
            training goes on from.
        metrics: file that gets a line of every epoch.
        progress: is told of every epoch.

    Returns:
        The weights of the lowest validation loss, and one report per epoch.
    """
    training, device = config.training, find_device(config.training.device)
    batches = TrainingBatches(config, data, network=network)
    masked = validation_buildings(config, data, vocabulary=network.vocabulary)
    validation = [network.read(part.seen, part.targets) for part in masked.batches(BATCH)]
    network.fit(data, config.data)
    steps = _GradientSteps(network, config, device=device)
    done = steps.restore(unfinished, data)
    saved = time.monotonic()
    write_bytes(metrics, encode_metrics(done.reports).encode())
    for epoch in range(len(done.reports) + 1, training.epochs + 1):
        if done.waited(training.patience):
            break
        began = time.perf_counter()
        train_loss, val_loss = steps.train_epoch(batches, epoch), None
        if epoch % training.validate_every == 0 or epoch == training.epochs:
            val_loss = _validate(steps.on_cpu(), validation)
        if not np.isfinite([train_loss, val_loss or 0.0]).all():
            raise TrainingError(
                f"{config.name}: the loss of epoch {epoch} is not finite (training {train_loss}, "
                f"validation {val_loss}); lower training.learning_rate"
            )
        if done.add(epochs=training.epochs, train_loss=train_loss, val_loss=val_loss, began=began):
            done.best = steps.on_cpu().state()
        is_due = time.monotonic() - saved >= SECONDS_BETWEEN_SAVES
        if val_loss is not None and (is_due or epoch == training.epochs):
            steps.save(unfinished, data, done)
            saved = time.monotonic()
        with metrics.open("a", encoding="utf-8") as file:
            file.write(encode_metrics(done.reports[-1:], header=False))
        progress(done.reports[-1])
    network.cpu()  # where it answers
    return done.best, done.reports


def _validate(model: TorchModule, validation: Sequence[Any]) -> float:
    """Return a model's loss per (node, class) cell."""
    parts = [model.validation_loss(some) for some in validation]
    return sum(total for total, _ in parts) / max(sum(cells for _, cells in parts), 1)


def _make_optimiser(model: TorchModule, training: TrainingConfig) -> torch.optim.Optimizer:
    """Return Adam with the decay as `training.decay_as` reads it.

    `fused` steps all tensors in one call, a fifth of the time of the usual way.
    """
    if training.decay_as == "decoupled":
        matrices = [
            p for p in model.parameters() if p.ndim > 1 and p.requires_grad
        ]  # norms and biases do not decay
        vectors = [p for p in model.parameters() if p.ndim <= 1]
        groups = [
            {"params": matrices, "weight_decay": training.decay},
            {"params": vectors, "weight_decay": 0.0},
        ]
        return torch.optim.AdamW(groups, lr=training.learning_rate, fused=True)
    decay = training.decay if training.decay_as == "weight-decay" else 0.0
    return torch.optim.Adam(
        model.parameters(), lr=training.learning_rate, weight_decay=decay, fused=True
    )


def learning_rate(training: TrainingConfig, step: int, *, steps: int) -> float:
    """Return the learning rate of a step, counted from 0, of `steps` in all.

    >>> learning_rate(TrainingConfig(decay=0.5, decay_as="learning-rate"), 2, steps=9)
    0.005
    >>> cycle = TrainingConfig(schedule="one-cycle", learning_rate=1.0)
    >>> [round(learning_rate(cycle, step, steps=20), 2) for step in (0, 1, 10, 19)]
    [0.5, 1.0, 0.54, 0.01]
    """
    rate = training.learning_rate
    if training.decay_as == "learning-rate":
        rate /= 1 + training.decay * step
    if training.schedule == "one-cycle":
        rising = max(1, steps // 10)
        if step < rising:
            return rate * (step + 1) / rising
        return rate * 0.5 * (1 + math.cos(math.pi * (step - rising + 1) / (steps - rising + 1)))
    return rate


def _optimiser_state(optimiser: torch.optim.Optimizer, model: TorchModule) -> State:
    """Return Adam's state by the names of the parameters, on the CPU."""
    return {
        f"{name}.{key}": torch.as_tensor(value).cpu().numpy().copy()
        for name, parameter in model.named_parameters()
        for key, value in optimiser.state[parameter].items()
    }


def _load_optimiser(optimiser: torch.optim.Optimizer, model: TorchModule, state: State) -> None:
    """Restore what `_optimiser_state` returned; parameters that do not learn have no state."""
    for name, parameter in model.named_parameters():
        for key in ("step", "exp_avg", "exp_avg_sq") if parameter.requires_grad else ():
            value = torch.tensor(state[f"{name}.{key}"], device=parameter.device)
            optimiser.state[parameter][key] = value
