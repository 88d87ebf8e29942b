"""Train a network on masked graphs (paper, section IV-A), or fit a model by counting.

The order and the dropout of an epoch are drawn from (seed, epoch) alone, its masks from (the mask's
own seed, epoch): they do not depend on the epochs before it having run in this process. A run that
was stopped therefore goes on to the same weights as one that was not.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch_geometric.loader import DataLoader

from bsg_data.lock import hold
from bsg_data.shards import write_bytes
from bsg_models.checkpoint import (
    Checkpoint,
    CheckpointHeader,
    load_checkpoint,
    restore_model,
    save_checkpoint,
)
from bsg_models.config import RunConfig
from bsg_models.errors import TrainingError
from bsg_models.graph_dataset import Buildings, MaskedGraphs, open_dataset
from bsg_models.learning_curve import EpochReport, encode_metrics, read_metrics
from bsg_models.model import BeliefModel
from bsg_models.optimiser import learning_rate, load_optimiser, make_optimiser, optimiser_state
from bsg_models.zoo import make_model

BEST, LAST = "best.safetensors", "last.safetensors"
METRICS, CURVE = "metrics.csv", "curve.png"


def train_run(
    config: RunConfig, dataset: Path, run: Path, *, resume: bool = False, force: bool = False
) -> Iterator[EpochReport]:
    """Train a configuration on a dataset, epoch by epoch, into the folder of a run.

    Args:
        config: of the run.
        dataset: that is split and has pairs.
        run: folder for `best.safetensors`, `last.safetensors` and `metrics.csv`.
        resume: go on from `last.safetensors`; without it, start.
        force: replace a run that is there.

    Yields:
        one report an epoch; a model that is fitted by counting yields none.

    Raises:
        TrainingError: if the run is in the way, cannot be resumed, or the loss is not finite.
        DatasetError: if the dataset lacks a split or its pairs.
    """
    data = open_dataset(dataset)
    model = _new_model(config, data)
    _refuse_overwriting(run, resume=resume, force=force)
    if not model.trainable:
        if resume:
            raise TrainingError(
                f"{config.model.family} is fitted by counting: there is nothing to resume"
            )
        model.fit(data, data.scenes_of("train", fold=config.data.fold))
        with _writing(run):
            _clear(run)
            header = _header(config, data)
            save_checkpoint(run / BEST, header, _tensors("model", model.state_dict()))
        return
    graphs = TrainingGraphs(config, data)  # a dataset that cannot be trained on fails here
    with _writing(run), one_thread():
        if not resume:
            _clear(run)
        yield from _train(model, config, data, run, graphs)


class TrainingGraphs:
    """The graphs of every epoch of one training, from a dataset that was opened once."""

    def __init__(self, config: RunConfig, data: Buildings) -> None:
        self._data, self._choice = data, config.data
        fold, edges = config.data.fold, config.data.edges
        self.val = MaskedGraphs.stored(data, "val", fold=fold, edges=edges)
        self._fixed = (
            MaskedGraphs.stored(data, "train", fold=fold, edges=edges)
            if config.data.masks == "fixed"
            else None
        )
        data.scenes_of("train", fold=fold)

    def of_epoch(self, epoch: int) -> MaskedGraphs:
        """Return the stored pairs, or mask number `epoch` of every training building."""
        if self._fixed is not None:
            return self._fixed
        return MaskedGraphs.fresh(
            self._data,
            "train",
            mask=self._choice.mask,
            draw=epoch,
            fold=self._choice.fold,
            edges=self._choice.edges,
        )


@contextmanager
def _writing(run: Path) -> Iterator[None]:
    """Make the folder of a run and hold its lock: two trainings never write into one."""
    try:
        run.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TrainingError(f"{run}: cannot be made ({error.strerror})") from error
    with hold(run):
        yield


def _new_model(config: RunConfig, data: Buildings) -> BeliefModel:
    torch.manual_seed(config.seed)
    return make_model(config, classes=len(data.manifest.class_map.classes))


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
    model: BeliefModel, config: RunConfig, data: Buildings, run: Path, graphs: TrainingGraphs
) -> Iterator[EpochReport]:
    training = config.training
    optimiser = make_optimiser(model, training)
    start, best_epoch, best_loss = 0, 0, float("inf")
    rows: list[EpochReport] = []
    if (run / LAST).exists():
        header = _restore(model, optimiser, config, data, run)
        start, best_epoch, best_loss = header.epoch, header.best_epoch, header.best_loss or 0.0
        rows = [row for row in read_metrics(run / METRICS) if row.epoch <= start]
    for epoch in range(start + 1, training.epochs + 1):
        began = time.perf_counter()
        train_loss = _train_epoch(model, optimiser, config, graphs.of_epoch(epoch), epoch=epoch)
        val_loss = None
        if epoch % training.validate_every == 0 or epoch == training.epochs:
            val_loss = validation_loss(model, graphs.val)
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
            header = _header(
                config,
                data,
                epoch=epoch,
                val_loss=val_loss,
                best_epoch=best_epoch,
                best_loss=best_loss,
            )
            state = _tensors("model", model.state_dict())
            write_bytes(run / METRICS, encode_metrics(rows))
            if is_best:
                save_checkpoint(run / BEST, header, state)
            adam = _tensors("adam", optimiser_state(optimiser, model))
            save_checkpoint(run / LAST, header, {**state, **adam})
        yield report


def _restore(
    model: BeliefModel,
    optimiser: torch.optim.Adam,
    config: RunConfig,
    data: Buildings,
    run: Path,
) -> CheckpointHeader:
    checkpoint = _load_last(run / LAST, config, data)
    if not (run / BEST).is_file():
        raise TrainingError(f"{run / BEST}: is gone; --force starts the run again")
    model.load_state_dict(restore_model(run / LAST, checkpoint).state_dict())
    load_optimiser(optimiser, model, checkpoint.state_of("adam"), path=run / LAST)
    return checkpoint.header


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
    graphs: MaskedGraphs,
    *,
    epoch: int,
) -> float:
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


def _refuse_overwriting(run: Path, *, resume: bool, force: bool) -> None:
    if run.exists() and not run.is_dir():
        raise TrainingError(f"{run}: is a file; a run is a folder")
    if any((run / name).exists() for name in (BEST, LAST, METRICS)) and not (resume or force):
        raise TrainingError(f"{run}: holds a run already; --resume goes on, --force replaces it")


def _clear(run: Path) -> None:
    for name in (BEST, LAST, METRICS, CURVE):
        (run / name).unlink(missing_ok=True)


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
        differing = ", ".join(_differences(header.config.model_dump(), same.model_dump()))
        raise TrainingError(
            f"{path}: was trained with another configuration ({differing}); only training.epochs "
            "may change. Choose another --out, or --force"
        )
    return checkpoint


def _differences(old: dict[str, Any], new: dict[str, Any], path: str = "") -> Iterator[str]:
    """Yield `path: old → new` of every value that differs."""
    for key in old.keys() | new.keys():
        a, b = old.get(key), new.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differences(a, b, f"{path}{key}.")
        elif a != b:
            yield f"{path}{key}: {a} → {b}"


def _header(
    config: RunConfig,
    data: Buildings,
    *,
    epoch: int = 0,
    val_loss: float | None = None,
    best_epoch: int = 0,
    best_loss: float | None = None,
) -> CheckpointHeader:
    return CheckpointHeader(
        config=config,
        class_map=data.manifest.class_map,
        dataset_sha256=data.sha256,
        epoch=epoch,
        val_loss=val_loss,
        best_epoch=best_epoch,
        best_loss=best_loss,
    )


def _tensors(prefix: str, state: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    return {f"{prefix}.{name}": tensor for name, tensor in state.items()}
