"""Train one configuration on one dataset: by gradient, by counting, or as an ensemble.

A run is written as a whole when its training is done. Meanwhile a network keeps `metrics.csv` and
what it needs to go on in `RUN.partial`; the same command goes on from there after a kill.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import torch

from bsg_data.dataset.dataset import Dataset
from bsg_data.files import AnyPath, noting_failures, refuse_links, resolve_links, write_bytes
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings, stack_masked
from bsg_data.places import BUILD
from bsg_data.results import name_staged, write_results
from bsg_models.belief.count_distribution import concatenate
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of, vocabulary_of
from bsg_models.rendering.figures import plot_learning_curve
from bsg_models.runs.checkpoint import read_header, save_model
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.runs.run_folder import (
    CONFIG,
    CURVE,
    METRICS,
    RECORD,
    EpochReport,
    TrainingRecord,
    encode_metrics,
    list_trained_on,
)
from bsg_models.training.buildings import validation_buildings
from bsg_models.training.count_gradients import as_network
from bsg_models.training.epochs import Progress, train_network
from bsg_models.zoo.building_tilt import fit_building_tilt, share_to_tilt
from bsg_models.zoo.calibration import (
    CalibratedModel,
    fit_calibration,
    fit_presence_calibration,
    take_sample,
)
from bsg_models.zoo.config import RunConfig, find_member, write_toml
from bsg_models.zoo.model import BeliefModel, make_model, one_thread
from bsg_models.zoo.torch_module import TorchModule

_PACKAGES = ("belief-scene-graphs", "numpy", "torch", "torch-geometric")
_CALIBRATED_NODES = 5_000  # under masks; their distributions take a few hundred megabytes


def train_run(
    config: RunConfig,
    dataset: AnyPath,
    run: AnyPath,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> tuple[EpochReport, ...]:
    """Train a configuration on a dataset into the folder of a run, or go on after a kill.

    Args:
        config: of the run.
        dataset: folder of a split dataset with pairs.
        run: folder for `best.safetensors`, `config.toml`, `training.json`, and for networks
            `metrics.csv` and `curve.png`.
        force: replace a finished run, which stays until the new one is whole, and what a stopped
            training of other settings left.
        progress: is told of every epoch.

    Returns:
        One report per epoch; none for a model that is fitted by counting.

    Raises:
        TrainingError: if the loss is not finite, or a stopped training of other settings is there.
        DatasetError: if the dataset lacks a split or its pairs, or a run is in the way.
    """
    data, run, began = Dataset.open(Path(dataset)), resolve_links(Path(run)), time.perf_counter()
    partial = name_staged(run)
    refuse_links(run.parent, partial)
    with write_results(run, report=BEST, force=force, goes_on=True) as staged:
        training = _Training(data, staged, progress or (lambda _: None), force)
        model, reports = training.train(config)
        save_model(model, config, data, staged / BEST, **_describe(model, config, reports))
        write_bytes(staged / CONFIG, write_toml(config).encode())
        notes = list(model.notes)
        if reports:
            write_bytes(staged / METRICS, encode_metrics(reports).encode())
            with noting_failures(notes):
                title = f"{config.name}, seed {config.seed}"
                plot_learning_curve(reports, staged / CURVE, title=title)
        else:
            (staged / METRICS).unlink(missing_ok=True)  # of the members of an ensemble
        record = TrainingRecord(
            time=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            seconds=round(time.perf_counter() - began, 3),
            versions={name: version(name) for name in _PACKAGES}
            | {"python": platform.python_version()},
            notes=tuple(notes),
            trained_on=list_trained_on(data, scenes_of(data, "train", fold=config.data.fold)),
        )
        write_bytes(staged / RECORD, (record.model_dump_json(indent=1) + "\n").encode())
    return tuple(reports)


def _describe(
    model: BeliefModel, config: RunConfig, reports: Sequence[EpochReport]
) -> dict[str, Any]:
    """Return what a checkpoint says of a training, besides its configuration."""
    fields: dict[str, Any] = {
        "members": {name: member_config(config, name) for name in model.members},
        "calibrated": _is_calibrated(model, config),
    }
    if reports:
        best = reports[reports[-1].best_epoch - 1]
        fields |= {"epoch": best.epoch, "val_loss": best.val_loss}
        fields |= {"best_epoch": best.epoch, "best_loss": best.val_loss}
    return fields


@dataclass(frozen=True, eq=False)
class _Training:
    """What the trainings of a model and of its members share."""

    data: Dataset
    staged: Path  # folder of the run, with what a stopped training goes on from
    progress: Progress
    force: bool  # whether it may replace what another training left

    def train(
        self, config: RunConfig, *, name: str = "network"
    ) -> tuple[BeliefModel, list[EpochReport]]:
        """Return a trained model; `name` is its own in the folder of unfinished trainings."""
        model, reports = new_model(config, self.data), list[EpochReport]()
        network = as_network(model)
        with one_thread():
            for number, member in enumerate(model.members):
                own = member_config(config, member)
                model.members[member] = self.train(own, name=f"member-{number}")[0]
            if network is not None:
                unfinished = self.staged / BUILD / f"{name}.safetensors"
                reports = self._train_network(network, model, config, unfinished)
            elif not model.members:
                model.fit(self.data, config.data)
            if _is_calibrated(model, config):
                vocabulary = model.vocabulary
                masked = validation_buildings(config, self.data, vocabulary=vocabulary)
                _calibrate_on(model, masked)
        return model, reports

    def _train_network(
        self, network: TorchModule, model: BeliefModel, config: RunConfig, unfinished: Path
    ) -> list[EpochReport]:
        """Train a network, and let the model that it stands for take its weights."""
        if not self.force:
            _refuse_other(unfinished, config, self.data)
        best, reports = train_network(
            network,
            config,
            self.data,
            unfinished=unfinished,
            metrics=self.staged / METRICS,
            progress=self.progress,
        )
        model.load_state(best)
        last = reports[-1]
        if last.epoch < config.training.epochs:
            later = sum(report.val_loss is not None for report in reports[last.best_epoch :])
            note = (
                f"stopped after epoch {last.epoch}, as training.patience says: {later} validations "
                f"were no better than that of epoch {last.best_epoch}"
            )
            model.notes = (*model.notes, note)
        return reports


def _refuse_other(unfinished: Path, config: RunConfig, data: Dataset) -> None:
    """Refuse to write over what a stopped training of other settings or data left."""
    if unfinished.exists() and not read_header(unfinished).is_of(config, data):
        raise TrainingError(
            f"{unfinished.parents[1]}: a stopped training of other settings or another dataset can "
            "go on from here; choose another --out, or give it up by --force",
            code="training-other",
            where=unfinished.parents[1],
        )


def new_model(config: RunConfig, data: Dataset) -> BeliefModel:
    """Return a new model for a dataset; its vocabulary is that of the training set."""
    torch.manual_seed(config.seed)
    scenes = scenes_of(data, "train", fold=config.data.fold)
    vocabulary: tuple[str, ...] = ()
    if config.reads_categories:
        vocabulary = vocabulary_of(data, scenes, min_scenes=config.data.min_scenes)
    classes = len(data.manifest.class_space.classes)
    return make_model(config, classes=classes, vocabulary=vocabulary)


def _is_calibrated(model: BeliefModel, config: RunConfig) -> TypeGuard[CalibratedModel]:
    """Return whether the configuration wants a model calibrated on val that can be."""
    return isinstance(model, CalibratedModel) and getattr(config.model, "calibrate", False)


def _calibrate_on(model: CalibratedModel, every: MaskedBuildings) -> None:
    """Calibrate a model on masked buildings, or on a sample whose distributions fit in memory."""
    masked = take_sample(every, limit=_CALIBRATED_NODES)
    if len(masked) < len(every):
        note = (
            f"calibrated on a random sample of {len(masked):,} of {len(every):,} masked val "
            f"buildings: at most {_CALIBRATED_NODES:,} nodes"
        )
        model.notes = (*model.notes, note)
    calibrate(model, [(model, masked)])


def calibrate(
    model: CalibratedModel, unseen: Sequence[tuple[CalibratedModel, MaskedBuildings]]
) -> None:
    """Fit a model's calibration on masked buildings with their targets.

    Args:
        model: which is calibrated.
        unseen: buildings, each with the model that predicts them: this one, or models of the same
            recipe, such as those of a cross-validation. None was trained on its buildings.
    """
    batches = [(peer, batch) for peer, masked in unseen for batch in masked.batches(BATCH)]
    masked = stack_masked([batch.without_categories() for _, batch in batches])
    rooms = np.flatnonzero(~masked.seen.is_building)
    if not len(rooms):
        return
    hidden = masked.hidden.astype(np.float64)
    known = masked.known  # a cell that hides nothing for certain says nothing
    share = masked.seen.cell_share * known
    learned = concatenate([peer.predict_hidden_counts(batch.seen) for peer, batch in batches])
    learned = learned.without(~known)
    of_rooms = learned.take(rooms)
    fitted = fit_calibration(of_rooms, hidden[rooms])
    model.hold(calibration=fitted)
    recalibrated = of_rooms.recalibrated(fitted)
    lines = fit_presence_calibration(recalibrated, hidden[rooms], share=share[rooms])
    model.hold(presence_calibration=lines)
    presence = model.calibrate(learned, share).presence
    tilted = share_to_tilt(masked.seen, reads_labels=model.reads_labels)
    model.hold(building_calibration=fit_building_tilt(presence, masked, tilted))


def member_config(config: RunConfig, name: str) -> RunConfig:
    """Return the configuration of a member: its own recipe, with the ensemble's seed and data."""
    member = find_member(name)
    chosen = {name: getattr(config.data, name) for name in ("fold", "min_scenes")}
    data = member.data.model_copy(update={"mask": config.data.mask, **chosen})
    return member.model_copy(update={"seed": config.seed, "data": data})
