"""Train one configuration on one dataset: by gradient, by counting, or as an ensemble."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import cast

import numpy as np
import torch

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, refuse_links
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings, stack_masked
from bsg_data.results import require_seal
from bsg_models.belief.count_distribution import concatenate
from bsg_models.errors import CheckpointError, TrainingError
from bsg_models.inputs.folds import scenes_of, vocabulary_of
from bsg_models.runs.checkpoint import (
    is_finished,
    load_checkpoint,
    name_tensors,
    read_header,
    restore_model,
    save_checkpoint,
    save_fitted,
)
from bsg_models.runs.run_folder import (
    BEST,
    LAST,
    MEMBERS,
    active_folder,
    clear_run,
    finish_replacing,
    open_run,
    refuse_overwriting,
)
from bsg_models.runs.run_log import keep_log
from bsg_models.training.buildings import TrainingBuildings, validation_buildings
from bsg_models.training.count_gradients import as_network
from bsg_models.training.epochs import (
    GradientSteps,
    find_device,
    require_same_training,
    train_epochs,
)
from bsg_models.training.learning_curve import EpochReport
from bsg_models.zoo.building_tilt import fit_building_tilt, share_to_tilt
from bsg_models.zoo.calibration import (
    CalibratedModel,
    fit_calibration,
    fit_presence_calibration,
    take_sample,
)
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.ensemble import Ensemble, find_member, make_model, reads_categories
from bsg_models.zoo.model import BeliefModel, one_thread

_CALIBRATED_NODES = 5_000  # under masks; their distributions take a few hundred megabytes


def train_run(
    config: RunConfig, dataset: AnyPath, run: AnyPath, *, resume: bool = False, force: bool = False
) -> Iterator[EpochReport]:
    """Train a configuration on a dataset, epoch by epoch, into the folder of a run.

    Args:
        config: of the run.
        dataset: folder of a split dataset with pairs.
        run: folder for `best.safetensors`, `last.safetensors`, `metrics.csv`, `config.toml` (the
            configuration) and `log.jsonl` (when each training began and how it ended).
        resume: continue from `last.safetensors`, or from the finished members of an ensemble. A
            model fitted by counting starts again, unless it is finished. Without `resume`, start.
        force: replace an existing run; a finished one stays until the new one is whole. With
            `resume`, replace it only if it is of another training.

    Yields:
        One report per epoch; none for a model that is fitted by counting.

    Raises:
        TrainingError: if a run is in the way, cannot be resumed, or the loss is not finite.
        DatasetError: if the dataset lacks a split or its pairs.
    """
    dataset, run = Path(dataset), Path(run)
    data, device = Dataset.open(dataset), find_device(config.training.device)
    finish_replacing(run)
    refuse_overwriting(run, resume=resume, force=force)
    resume = resume and not (force and _is_other_training(config, data, run))
    if resume and _is_complete(config, data, run):
        return
    model = new_model(config, data)
    network = as_network(model)
    if network is not None:
        steps = GradientSteps(network, config, device=device)
        yield from _train_network(steps, config, data, run, resume=resume, force=force)
        return
    goes_on = resume and isinstance(model, Ensemble)  # a model that counts starts again
    opened = open_run(run, resume=goes_on, force=force or resume)
    with opened as place, keep_log(place, config, data) as notes:
        if isinstance(model, Ensemble):
            members = yield from _train_members(config, data, place)
            _combine(model, config, data, members, place)
        else:
            _fit(model, config, data, place)
        notes += model.notes


def _is_complete(config: RunConfig, data: Dataset, run: Path) -> bool:
    """Return whether a run is sealed, and trained for as many epochs as are asked for."""
    place = active_folder(run)
    best, last = place / BEST, place / LAST
    _require_resumable(config, data, place)
    epochs = read_header(last).epoch if last.is_file() else config.training.epochs
    is_trained = epochs >= config.training.epochs
    return best.is_file() and is_trained and require_seal(place) is not None


def _fit(model: BeliefModel, config: RunConfig, data: Dataset, run: Path) -> None:
    with one_thread():
        model.fit(data, config.data)
        calibrated = _calibrate_if_wanted(model, config, data)
        save_fitted(model, config, data, run, calibrated=calibrated)


def _train_network(
    steps: GradientSteps, config: RunConfig, data: Dataset, run: Path, *, resume: bool, force: bool
) -> Iterator[EpochReport]:
    """Train by gradient, then calibrate."""
    model = steps.model
    # An unsuitable dataset fails here, before anything is replaced.
    buildings = TrainingBuildings(config, data, vocabulary=model.vocabulary)
    masked = validation_buildings(config, data, vocabulary=model.vocabulary)
    validation = [model.nodes_of(one.seen, one.targets) for one in masked.batches(BATCH)]
    opened = open_run(run, resume=resume, force=force)
    with opened as place, keep_log(place, config, data) as notes, one_thread():
        model.fit(data, config.data)
        yield from train_epochs(steps, config, data, place, buildings, validation)
        notes += _calibrate_run(config, data, place)


def _is_other_training(config: RunConfig, data: Dataset, run: Path) -> bool:
    """Return whether a run cannot be continued, because it is of another training or damaged."""
    try:
        run = active_folder(run)
        _require_resumable(config, data, run)
        require_seal(run)
    except (TrainingError, CheckpointError, DatasetError):
        return True
    return (run / LAST).is_file() and not (run / BEST).is_file()


def _require_resumable(config: RunConfig, data: Dataset, run: Path) -> None:
    """Refuse to continue a run of another training, also of a model without a last checkpoint.

    A stopped ensemble is recognised by its members.
    """
    last = run / LAST
    require_same_training(config, data, last if last.is_file() else run / BEST)
    for name in getattr(config.model, "members", ()):
        with suppress(CheckpointError):  # a damaged member is trained again
            require_same_training(member_config(config, name), data, run / MEMBERS / name / BEST)


def new_model(config: RunConfig, data: Dataset) -> BeliefModel:
    """Return a new model for a dataset; its vocabulary is that of the training set."""
    torch.manual_seed(config.seed)
    scenes = scenes_of(data, "train", fold=config.data.fold)
    reads = reads_categories(config)
    return make_model(
        config,
        classes=len(data.manifest.class_space.classes),
        vocabulary=(
            vocabulary_of(data, scenes, min_scenes=config.data.min_scenes) if reads else ()
        ),
    )


def _calibrate_run(config: RunConfig, data: Dataset, run: Path) -> tuple[str, ...]:
    """Calibrate a run's best checkpoint if its configuration says so; return the model's notes."""
    checkpoint = load_checkpoint(run / BEST)
    model = restore_model(run / BEST, checkpoint)
    if _calibrate_if_wanted(model, config, data):
        header = checkpoint.header.model_copy(update={"calibrated": True})
        save_checkpoint(run / BEST, header, name_tensors("model", model.state()))
    return model.notes


def _calibrate_if_wanted(model: BeliefModel, config: RunConfig, data: Dataset) -> bool:
    """Calibrate a model on val if its configuration says so; return whether it did."""
    if not (isinstance(model, CalibratedModel) and getattr(config.model, "calibrate", False)):
        return False
    _calibrate_on(model, validation_buildings(config, data, vocabulary=model.vocabulary))
    return True


def _calibrate_on(model: CalibratedModel, every: MaskedBuildings) -> None:
    """Calibrate a model on masked buildings, or on a sample whose distributions fit in memory."""
    masked = take_sample(every, most=_CALIBRATED_NODES)
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
    every = [(one, some) for one, masked in unseen for some in masked.batches(BATCH)]
    masked = stack_masked([some.without_categories() for _, some in every])
    rooms = np.flatnonzero(~masked.seen.is_building)
    if not len(rooms):
        return
    hidden = masked.hidden.astype(np.float64)
    known = masked.known  # a cell that hides nothing for certain says nothing
    share = masked.seen.cell_share * known
    learned = concatenate([one.predict_hidden_counts(some.seen) for one, some in every])
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


def _train_members(
    config: RunConfig, data: Dataset, run: Path
) -> Generator[EpochReport, None, dict[str, Path]]:
    """Train the members of an ensemble, one after another; return the folder of each."""
    members = {name: run / MEMBERS / name for name in getattr(config.model, "members", ())}
    for name, folder in members.items():
        refuse_links(run, folder)
        member = member_config(config, name)
        if is_finished(folder, member, data):
            continue
        again = (folder / LAST).is_file()
        if not again:
            clear_run(folder)
        yield from train_run(member, data.path, folder, resume=again)
    return members


def member_config(config: RunConfig, name: str) -> RunConfig:
    """Return the configuration of a member: its own recipe, with the ensemble's seed and data."""
    member = find_member(name)
    chosen = {name: getattr(config.data, name) for name in ("fold", "min_scenes")}
    data = member.data.under(config.data.mask).model_copy(update=chosen)
    return member.model_copy(update={"seed": config.seed, "data": data})


def combine_runs(config: RunConfig, data: Dataset, members: Mapping[str, Path], run: Path) -> None:
    """Make the ensemble of trained runs, calibrate it on val, and save it.

    Args:
        config: of the ensemble.
        data: that the members were trained on.
        members: name in the zoo → folder of its run.
        run: folder of the ensemble.
    """
    model = cast(Ensemble, new_model(config, data))
    with open_run(run) as place, keep_log(place, config, data) as notes:
        _combine(model, config, data, members, place)
        notes += model.notes


def _combine(
    model: Ensemble, config: RunConfig, data: Dataset, members: Mapping[str, Path], run: Path
) -> None:
    """Mix the members, calibrate and save."""
    for name, folder in members.items():
        model.members[name] = restore_model(folder / BEST, load_checkpoint(folder / BEST))
    with one_thread():
        calibrated = _calibrate_if_wanted(model, config, data)
        recipes = {name: member_config(config, name) for name in members}
        save_fitted(model, config, data, run, calibrated=calibrated, members=recipes)
