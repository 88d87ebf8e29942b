"""Train a network on masked graphs (paper, section IV-A), or fit a model by counting.

Every epoch has its own generators, made of (seed, epoch) alone: masks, order and dropout of epoch k
do not depend on the epochs before it having run in this process. A run that was stopped therefore
goes on to the same weights as one that was not.
"""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch_geometric.loader import DataLoader

from bsg_data.manifest import ClassMapEntry
from bsg_data.shards import write_bytes
from bsg_models.checkpoint import (
    Checkpoint,
    CheckpointHeader,
    load_checkpoint,
    restore_model,
    save_checkpoint,
)
from bsg_models.config import RunConfig, TrainingConfig
from bsg_models.errors import TrainingError
from bsg_models.graph_dataset import Buildings, MaskedGraphs, open_dataset
from bsg_models.model import BeliefModel
from bsg_models.zoo import make_model

BEST, LAST, METRICS = "best.safetensors", "last.safetensors", "metrics.csv"


@dataclass(frozen=True, slots=True)
class EpochReport:
    """What one epoch came to.

    Attributes:
        epoch: counted from 1.
        epochs: of the whole training.
        train_loss: mean over the epoch's steps.
        val_loss: on the stored pairs; None if this epoch was not validated.
        best_epoch: with the lowest val_loss so far.
        seconds: that the epoch took.
    """

    epoch: int
    epochs: int
    train_loss: float
    val_loss: float | None
    best_epoch: int
    seconds: float


def train_run(
    config: RunConfig, dataset: Path, run: Path, *, resume: bool = False, force: bool = False
) -> Iterator[EpochReport]:
    """Train a configuration on a dataset, epoch by epoch, into the folder of a run.

    Args:
        config: of the run.
        dataset: that is split and has pairs.
        run: folder for `best.safetensors`, `last.safetensors` and `metrics.csv`.
        resume: go on from `last.safetensors`.
        force: replace a run that is there.

    Yields:
        one report an epoch; a model that is fitted by counting yields none.

    Raises:
        TrainingError: if the run is in the way, cannot be resumed, or the loss is not finite.
        DatasetError: if the dataset lacks a split or its pairs.
    """
    data = open_dataset(dataset)
    classes = len(data.manifest.class_map.classes)
    _prepare(run, resume=resume, force=force)
    torch.manual_seed(config.seed)
    model = make_model(config, classes=classes)
    if not model.trainable:
        model.fit(data, data.scenes_of("train", fold=config.data.fold))
        header = _header(config, data, epoch=0, val_loss=None)
        save_checkpoint(run / BEST, header, _tensors("model", model.state_dict()))
        return
    with one_thread():
        yield from _train(model, config, data, run, resume=resume)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch compute on one thread: sums then do not depend on the number of cores.

    These networks are so small that more threads are not faster.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _train(
    model: BeliefModel, config: RunConfig, data: Buildings, run: Path, *, resume: bool
) -> Iterator[EpochReport]:
    training = config.training
    val = MaskedGraphs.stored(data.path, "val", fold=config.data.fold, edges=config.data.edges)
    optimiser = make_optimiser(model, training)
    start, best_epoch, best_loss = 0, 0, float("inf")
    rows: list[EpochReport] = []
    if resume:
        checkpoint = _load_last(run / LAST, config, data)
        start = checkpoint.header.epoch
        model.load_state_dict(restore_model(run / LAST, checkpoint).state_dict())
        load_optimiser(optimiser, model, checkpoint.state_of("adam"))
        rows = [row for row in read_metrics(run / METRICS) if row.epoch <= start]
        validated = [row for row in rows if row.val_loss is not None]
        best = min(validated, key=lambda row: (row.val_loss, row.epoch))
        best_epoch, best_loss = best.epoch, float(best.val_loss or 0.0)
    for epoch in range(start + 1, training.epochs + 1):
        began = time.perf_counter()
        train_loss = _train_epoch(model, optimiser, config, data, epoch=epoch)
        if not np.isfinite(train_loss):
            raise TrainingError(
                f"{run}: the loss of epoch {epoch} is {train_loss}; lower training.learning_rate. "
                f"The checkpoints are of earlier epochs"
            )
        val_loss = None
        if epoch % training.validate_every == 0 or epoch == training.epochs:
            val_loss = validation_loss(model, val)
            header = _header(config, data, epoch=epoch, val_loss=val_loss)
            state = _tensors("model", model.state_dict())
            if val_loss < best_loss:
                best_epoch, best_loss = epoch, val_loss
                save_checkpoint(run / BEST, header, state)
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
            write_bytes(run / METRICS, encode_metrics(rows))
            adam = _tensors("adam", optimiser_state(optimiser, model))
            save_checkpoint(run / LAST, header, {**state, **adam})
        yield report


def make_optimiser(model: BeliefModel, training: TrainingConfig) -> torch.optim.Adam:
    """Return Adam with the paper's learning rate, and its decay if read as weight decay."""
    decay = training.decay if training.decay_as == "weight-decay" else 0.0
    return torch.optim.Adam(model.parameters(), lr=training.learning_rate, weight_decay=decay)


def learning_rate(training: TrainingConfig, step: int) -> float:
    """Return the learning rate of a step, counted from 0.

    >>> learning_rate(TrainingConfig(decay=0.5, decay_as="learning-rate"), 2)
    0.005
    """
    if training.decay_as == "weight-decay":
        return training.learning_rate
    return training.learning_rate / (1 + training.decay * step)


def validation_loss(model: BeliefModel, graphs: MaskedGraphs) -> float:
    """Return the mean squared error of the totals, not below 0, over all nodes and classes."""
    error, count = 0.0, 0
    for batch in DataLoader(graphs, batch_size=256):
        totals = model.predict(batch).totals
        error += float(((totals - batch.y.numpy()) ** 2).sum())
        count += totals.size
    return error / max(count, 1)


def _train_epoch(
    model: BeliefModel,
    optimiser: torch.optim.Adam,
    config: RunConfig,
    data: Buildings,
    *,
    epoch: int,
) -> float:
    graphs = _graphs_of_epoch(config, data, epoch)
    seed = int(np.random.SeedSequence([config.seed, epoch]).generate_state(1)[0])
    torch.manual_seed(seed)  # of dropout
    order = torch.Generator().manual_seed(seed)
    loader = DataLoader(
        graphs, batch_size=config.training.batch_size, shuffle=True, generator=order
    )
    model.train()
    losses = []
    for batch_number, batch in enumerate(loader):
        step = (epoch - 1) * len(loader) + batch_number
        for group in optimiser.param_groups:
            group["lr"] = learning_rate(config.training, step)
        optimiser.zero_grad()
        loss = torch.nn.functional.mse_loss(model(batch), batch.y)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        losses.append(loss.item())
    return float(np.mean(losses))


def _graphs_of_epoch(config: RunConfig, data: Buildings, epoch: int) -> MaskedGraphs:
    fold, edges = config.data.fold, config.data.edges
    if config.data.masks == "fixed":
        return MaskedGraphs.stored(data.path, "train", fold=fold, edges=edges)
    return MaskedGraphs.fresh(
        data.path, "train", mask=config.data.mask, draw=epoch, fold=fold, edges=edges
    )


def _prepare(run: Path, *, resume: bool, force: bool) -> None:
    there = [name for name in (BEST, LAST, METRICS) if (run / name).exists()]
    if resume:
        return
    if there and not force:
        raise TrainingError(f"{run}: holds a run already; --resume goes on, --force replaces it")
    if run.exists() and not run.is_dir():
        raise TrainingError(f"{run}: is a file; a run is a folder")
    for name in there:
        (run / name).unlink()


def _load_last(path: Path, config: RunConfig, data: Buildings) -> Checkpoint:
    checkpoint = load_checkpoint(path)
    header = checkpoint.header
    if header.dataset_sha256 != data.sha256:
        raise TrainingError(
            f"{path}: was trained on another dataset (manifest {header.dataset_sha256[:12]}…, "
            f"this one {data.sha256[:12]}…); resume with the same, or start a new run"
        )
    same = config.model_copy(
        update={
            "training": config.training.model_copy(update={"epochs": header.config.training.epochs})
        }
    )
    if header.config != same:
        raise TrainingError(
            f"{path}: was trained with another configuration; only training.epochs may change"
        )
    return checkpoint


def _header(
    config: RunConfig, data: Buildings, *, epoch: int, val_loss: float | None
) -> CheckpointHeader:
    entry = data.manifest.class_map
    return CheckpointHeader(
        config=config,
        class_map=ClassMapEntry(version=entry.version, sha256=entry.sha256, classes=entry.classes),
        dataset_sha256=data.sha256,
        epoch=epoch,
        val_loss=val_loss,
    )


def _tensors(prefix: str, state: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    return {f"{prefix}.{name}": tensor for name, tensor in state.items()}


def optimiser_state(optimiser: torch.optim.Adam, model: BeliefModel) -> dict[str, torch.Tensor]:
    """Return Adam's state by the names of the parameters."""
    return {
        f"{name}.{key}": torch.as_tensor(value)
        for name, parameter in model.named_parameters()
        for key, value in optimiser.state[parameter].items()
    }


def load_optimiser(
    optimiser: torch.optim.Adam, model: BeliefModel, state: dict[str, torch.Tensor]
) -> None:
    """Give Adam back what `optimiser_state` took from it."""
    for name, parameter in model.named_parameters():
        optimiser.state[parameter] = {
            key: state[f"{name}.{key}"].clone() for key in ("step", "exp_avg", "exp_avg_sq")
        }


def encode_metrics(rows: list[EpochReport]) -> bytes:
    """Return reports as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["epoch", "epochs", "train_loss", "val_loss", "best_epoch", "seconds"])
    for row in rows:
        val = "" if row.val_loss is None else repr(row.val_loss)
        numbers = [row.epoch, row.epochs, repr(row.train_loss), val, row.best_epoch]
        writer.writerow([*numbers, f"{row.seconds:.4f}"])
    return text.getvalue().encode()


def read_metrics(path: Path) -> list[EpochReport]:
    """Read what `encode_metrics` wrote.

    Raises:
        TrainingError: if the file is missing or damaged.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                EpochReport(
                    epoch=int(row["epoch"]),
                    epochs=int(row["epochs"]),
                    train_loss=float(row["train_loss"]),
                    val_loss=float(row["val_loss"]) if row["val_loss"] else None,
                    best_epoch=int(row["best_epoch"]),
                    seconds=float(row["seconds"]),
                )
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, ValueError, TypeError) as error:
        raise TrainingError(f"{path}: not the metrics of a run ({error})") from error
