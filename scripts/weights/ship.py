"""Make the shipped models: train each on all buildings of its dataset, check it, write its card.

WORK/NAME/dataset    a copy of the dataset: nine tenths train, one tenth chooses the best epoch
WORK/NAME/run        the run
WORK/NAME/folds      a copy in five folds, and WORK/NAME/fold-K the runs without fold K. What these
                     predict of the folds that they have not seen calibrates the model
OUT/NAME.safetensors the model alone, in single precision, without the optimiser
OUT/NAME.md          its card; `make docs` fills in its accuracy
OUT/SHA256SUMS       of both, of every model

A command that was stopped goes on where it was. The same datasets give the same bytes.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from disclosure import find_disclosed, measure_membership

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import hash_manifest, read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import BSGError, DatasetError
from bsg_data.files import write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked, stack_masked
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.registry import require_known
from bsg_data.seal import write_seal
from bsg_models.errors import CheckpointError
from bsg_models.evaluation.measurement import predict_all
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import (
    CheckpointHeader,
    is_finished,
    load_checkpoint,
    name_tensors,
    restore_model,
    save_checkpoint,
)
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.runs.found_model import SUFFIX
from bsg_models.runs.model_card import ModelCard, write_card
from bsg_models.runs.run_folder import list_trained_on
from bsg_models.training.buildings import mask_as_trained
from bsg_models.training.training import calibrate, train_run
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.model import BeliefModel, one_thread

SPLIT = SplitRecipe(ratios=(0.9, 0.1, 0.0))
ACROSS = SplitRecipe(method="folds", ratios=None, folds=5)
DRAWS = 10  # masks of every building that chooses the best epoch
FOLD_DRAWS = 6  # masks of every building that calibrates
ATTACKED = 3  # masks of every building that the membership attack sees
_CLOSE = 1e-3  # of a presence: what single precision may change


class Shipped(NamedTuple):
    """A model that is shipped.

    Attributes:
        data: the option that names its dataset.
        config: name in the zoo.
        purpose: what it is for, in one line.
        settings: of the configuration, as `bsg-train --set` takes them.
        like_it: how the models that the leaderboard measures under its name were trained, if any.
    """

    data: str
    config: str
    purpose: str
    settings: tuple[str, ...] = ()
    like_it: str = ""


# What counts is calibrated on every mask, as networks are.
_MIXED = (
    "data.mask.strategy=mixed",
    "data.mask.withhold=0.05",
    "data.mask.detector=0.25",
    "data.fractions=[0.1, 0.9]",
)

MODELS: Mapping[str, Shipped] = {
    "universal": Shipped(
        "pooled",
        "universal",
        "The default: 45 classes, whatever was seen.",
        like_it="on HM3D alone",
    ),
    "universal-wide": Shipped("wide", "universal", "170 classes: shoes, clocks, laptops."),
    "mixture": Shipped(
        "pooled",
        "mixture",
        "Sixteen latent room types: fast and plain.",
        _MIXED,
        "on HM3D alone and under the masks of the test",
    ),
    "ensemble": Shipped(
        "pooled",
        "ensemble",
        "Room types and `universal` as one: the likeliest.",
        like_it="on HM3D alone",
    ),
    # What BEHAVIOR's modelled rooms hide says little of others: calibrated on them, it was worse.
    "open": Shipped(
        "behavior",
        "mixture",
        "45 classes, for any use: a table written by hand (Apache-2.0), and a few modelled homes.",
        ("model.kinds=named", "model.temper=0.6", "model.calibrate=false"),
    ),
}


def configure(
    name: str, *, config_of: Mapping[str, str], settings: Mapping[str, Sequence[str]]
) -> RunConfig:
    """Return the configuration of a shipped model, with what the command line changes of it."""
    chosen = config_of.get(name, MODELS[name].config)
    fixed = MODELS[name].settings if name not in config_of else ()
    tables = override(
        find_config(chosen).model_dump(mode="json"), [*fixed, *settings.get(name, ())]
    )
    return validate_config(tables, source=name)


def prepare_dataset(
    source: Path, copy: Path, config: RunConfig, split: SplitRecipe, *, force: bool
) -> Path:
    """Copy a dataset, split it and draw pairs; keep what is there already.

    Raises:
        DatasetError: if the copy is of another dataset, or of another mask.
    """
    stamp = copy.with_suffix(".sha256")
    recipe = f"{hash_manifest(source)}\n{config.data.mask.model_dump_json()}\n"
    if copy.exists() and (force or not stamp.is_file()):
        shutil.rmtree(copy)
        stamp.unlink(missing_ok=True)
    if not copy.exists():
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, copy)
        split_dataset(copy, split, force=read_manifest(copy).split is not None)
        write_pairs(copy, PairsRecipe(mask=config.data.mask, draws=DRAWS))
        write_bytes(stamp, recipe.encode())
    elif stamp.read_text("utf-8") != recipe:
        raise DatasetError(
            f"{copy}: is a copy of another dataset than {source} is now, or of another mask; "
            "--force makes it anew"
        )
    return copy


def train(config: RunConfig, dataset: Path, run: Path, *, force: bool) -> None:
    """Train a run, or go on with it; one that is finished stays."""
    if not force and is_finished(run, config, Dataset.open(dataset)):
        return
    train_run(
        config,
        dataset,
        run,
        force=True,
        progress=lambda report: print(f"  epoch {report.epoch}", end="\r", file=sys.stderr),
    )


def calibrate_across_folds(
    model: CalibratedModel, source: Path, folder: Path, config: RunConfig, *, force: bool
) -> None:
    """Calibrate a model by models of five folds: they predict ten times the buildings of val."""
    copy = prepare_dataset(source, folder / "folds", config, ACROSS, force=force)
    data, unseen = Dataset.open(copy), []
    for fold in range(len(data.splits)):
        own = config.model_copy(update={"data": config.data.model_copy(update={"fold": fold})})
        place = folder / f"fold-{fold}"
        train(own, copy, place, force=force)
        like_it = cast(CalibratedModel, restore_model(place / BEST, load_checkpoint(place / BEST)))
        scenes = scenes_of(data, "test", fold=fold)
        masked = mask_as_trained(own, data, scenes, vocabulary=like_it.vocabulary, draws=FOLD_DRAWS)
        unseen.append((like_it, masked))
    with one_thread():
        calibrate(model, unseen)


def strip(
    model: BeliefModel, header: CheckpointHeader, path: Path, masked: MaskedBuildings
) -> None:
    """Write a model alone, in single precision, and prove that it answers the same.

    Raises:
        CheckpointError: if single precision changes a presence.
    """
    tensors = {
        name: tensor.astype(np.float32) if tensor.dtype.kind == "f" else tensor
        for name, tensor in model.state().items()
    }
    save_checkpoint(path, header, name_tensors("model", tensors))
    before = predict_all(model, masked)
    after = predict_all(restore_model(path, load_checkpoint(path)), masked)
    change = float(np.abs(before.presence - after.presence).max())
    if change > _CLOSE:
        raise CheckpointError(f"{path}: single precision changes a presence by {change:.2g}")


def ship(
    name: str,
    source: Path,
    *,
    config: RunConfig,
    work: Path,
    out: Path,
    force: bool = False,
) -> None:
    """Make one model and its card.

    Raises:
        BSGError: if it cannot be trained, or its weights tell what they should not.
    """
    dataset = prepare_dataset(source, work / name / "dataset", config, SPLIT, force=force)
    train(config, dataset, work / name / "run", force=force)
    data, made = Dataset.open(dataset), work / name / f"{name}{SUFFIX}"
    best = load_checkpoint(work / name / "run" / BEST)
    whole = cast(CalibratedModel, restore_model(work / name / "run" / BEST, best))
    if getattr(config.model, "calibrate", False):
        calibrate_across_folds(whole, source, work / name, config, force=force)
    held_out = read_split(data, "val", vocabulary=whole.vocabulary)
    strip(whole, best.header, made, held_out)
    disclosure = find_disclosed(made, data)
    if disclosure.faults:
        raise CheckpointError(f"{made}: is not shipped: {'; '.join(disclosure.faults)}")
    checkpoint = load_checkpoint(made)
    model = restore_model(made, checkpoint)
    inside, outside = (
        _stack_draws(data, part, config, vocabulary=model.vocabulary) for part in ("train", "val")
    )
    card = ModelCard(
        name=name, purpose=MODELS[name].purpose, trained_on=list_trained_on(data, data.scene_ids)
    )
    text = write_card(
        card,
        fields=checkpoint.header.model_dump(mode="json"),
        accuracy=describe_accuracy(name),
        measured=(str(disclosure), str(measure_membership(model, inside, outside))),
    )
    write_bytes(out / f"{name}{SUFFIX}", made.read_bytes())
    write_bytes(out / f"{name}.md", text.encode())


def describe_accuracy(name: str) -> str:
    """Return what a card says of accuracy; `make docs` fills in the leaderboard's figures."""
    if not (like_it := MODELS[name].like_it):
        return ""
    return (
        f"Models like this one, trained {like_it}, predicted the buildings of HM3D in five folds. "
        "No model had seen the buildings that it predicted. ± is half the 95 % interval over "
        f"buildings.\n\n<!-- generated: accuracy {name} -->\n<!-- end -->"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the models that are asked for, then the list of their hashes."""
    options = _parse(arguments)
    only = options.only or [name for name in MODELS if getattr(options, MODELS[name].data)]
    try:
        for kind, names in (("shipped model", only), ("shipped model", options.config_of)):
            require_known(kind, names, MODELS)
        for name in only:
            source = getattr(options, MODELS[name].data)
            if source is None:
                raise DatasetError(f"{name} needs --{MODELS[name].data}")
            read_manifest(source)  # a dataset that is missing fails before anything is made
            print(f"{name}: {source}", file=sys.stderr)
            ship(
                name,
                source,
                config=configure(name, config_of=options.config_of, settings=options.settings),
                work=options.work,
                out=options.out,
                force=options.force,
            )
    except BSGError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    made = tuple(name for name in MODELS if (options.out / f"{name}{SUFFIX}").is_file())
    write_seal(options.out, [f"{name}{end}" for name in made for end in (SUFFIX, ".md")])
    print("PUBLISHED of tests/bsg_models/runs/test_shipped.py:")
    for name in made:
        print(f'    "{name}": "{hash_file(options.out / (name + SUFFIX))}",')
    return 0


def _stack_draws(
    data: Dataset, part: Any, config: RunConfig, *, vocabulary: tuple[str, ...]
) -> MaskedBuildings:
    """Return every building of a split under masks that no training drew."""
    mask = config.data.mask.model_copy(update={"seed": config.data.mask.seed + 1})
    scenes = scenes_of(data, part)
    draws = [
        sample_masked(data, scenes, mask=mask, draw=draw, vocabulary=vocabulary)
        for draw in range(ATTACKED)
    ]
    return stack_masked(draws)


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    for name, what in (
        ("pooled", "HM3D and BEHAVIOR merged, of 45 classes"),
        ("wide", "HM3D of 170 classes"),
        ("behavior", "BEHAVIOR alone"),
    ):
        parser.add_argument(f"--{name}", type=Path, help=f"dataset: {what}")
    parser.add_argument("--work", type=Path, required=True, help="folder of copies and runs")
    parser.add_argument("--out", type=Path, required=True, help="folder of the models: weights")
    parser.add_argument("--only", action="append", metavar="NAME", help="this one; can be repeated")
    parser.add_argument("--force", action="store_true", help="train again what is finished")
    parser.add_argument(
        "--config-of",
        action="append",
        default=[],
        metavar="NAME=MODEL",
        help="another model of the zoo",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME:PATH=VALUE",
        help="one value of a configuration",
    )
    options = parser.parse_args(arguments)
    pairs = [text.partition("=") for text in options.config_of]
    options.config_of = {name: model for name, _, model in pairs}
    options.settings = {}
    for text in options.set:
        name, _, setting = text.partition(":")
        options.settings.setdefault(name, []).append(setting)
    return options


if __name__ == "__main__":
    sys.exit(main())
