"""Measure a model that was trained on one source on buildings of another.

    python scripts/measure/transfer.py --hm3d hm3d --behavior behavior --runs runs --out transfer.md

The script trains the model on HM3D, on BEHAVIOR and on both, in folds by building. It tests each on
the buildings of the held-out fold: those of HM3D, the homes of BEHAVIOR, and the other buildings of
BEHAVIOR. Buildings of BEHAVIOR that share copied rooms are in one fold. Finished runs are kept.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Hashable, Iterator, Mapping, Sequence
from datetime import date
from pathlib import Path

from fold_models import FoldModel, measure_models
from results_page import (
    ResultsPage,
    ResultsTable,
    describe,
    format_estimate,
    is_told_apart,
    write_page,
)
from tallies import tally_likelihood

from bsg_data.dataset.commit import revise
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import MANIFEST
from bsg_data.dataset.splits import assign_splits, write_splits
from bsg_data.merge import merge_datasets
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_models.evaluation.bootstrap import Bootstrap, bootstrap
from bsg_models.evaluation.catalogue import METRICS
from bsg_models.evaluation.measurement import Measured, SplitWeights, predict_all, read_truth
from bsg_models.evaluation.streams import Stream
from bsg_models.evaluation.truth import Prediction
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, is_finished
from bsg_models.studies.leaderboard_runs import run_of
from bsg_models.training.training import train_run
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config

HM3D, BEHAVIOR, BOTH = "HM3D", "BEHAVIOR", "HM3D and BEHAVIOR"
TRAINED = {HM3D: "hm3d", BEHAVIOR: "behavior", BOTH: "both"}  # → folder below --runs
LEAST_THINGS = 5  # smaller rooms can be equal by chance


def prepare(sources: dict[str, Path], runs: Path, *, folds: int, seed: int) -> dict[str, Dataset]:
    """Return a copy of each source and of both merged, in the same folds, with stored pairs."""
    chosen: dict[str, int] = {}
    for name, source in sources.items():
        data = Dataset.open(source)
        if name == HM3D:
            recipe = SplitRecipe(method="folds", ratios=None, folds=folds, seed=seed)
            dealt = assign_splits(dict.fromkeys(data.scene_ids), recipe)
            chosen |= {scene: int(fold.removeprefix("fold-")) for scene, fold in dealt.items()}
        else:
            contents = {scene: tuple(list_contents(data, scene)) for scene in data.scene_ids}
            chosen |= deal_groups(group_copies(contents), number=folds)
    opened = {}
    for name, folder in TRAINED.items():
        copy = runs / folder / "dataset"
        if not (copy / MANIFEST).is_file():
            copy.parent.mkdir(parents=True, exist_ok=True)
            if name == BOTH:
                merge_datasets(list(sources.values()), copy)
            else:
                shutil.rmtree(copy, ignore_errors=True)
                shutil.copytree(sources[name], copy)
        if Dataset.open(copy).manifest.pairs is None:
            recipe = SplitRecipe(method="folds", ratios=None, folds=folds)
            dealt = {scene: f"fold-{chosen[scene]}" for scene in Dataset.open(copy).scene_ids}
            revise(copy, lambda old, a=copy, b=recipe, c=dealt: write_splits(a, old, b, c))
            write_pairs(copy, PairsRecipe(mask=MaskRecipe(seed=seed), draws=5), force=True)
        opened[name] = Dataset.open(copy)
    return opened


def group_copies(rooms: Mapping[str, Sequence[Hashable]]) -> list[tuple[str, ...]]:
    """Return the groups of buildings that share rooms, directly or through others, sorted.

    Args:
        rooms: scene id → the contents of its larger rooms; equal contents are copies.

    >>> group_copies({"a": [1, 2], "b": [3], "c": [2, 4], "d": [4], "e": []})
    [('a', 'c', 'd'), ('b',), ('e',)]
    """
    group_of = {scene: {scene} for scene in rooms}
    first: dict[Hashable, str] = {}
    for scene, contents in rooms.items():
        for content in contents:
            other = first.setdefault(content, scene)
            joined = group_of[other] | group_of[scene]
            group_of.update(dict.fromkeys(joined, joined))
    return sorted({tuple(sorted(group)) for group in group_of.values()})


def deal_groups(groups: Sequence[tuple[str, ...]], *, number: int) -> dict[str, int]:
    """Return scene id → fold: the largest group first, each into the fold with the fewest scenes.

    >>> deal_groups([("a", "c", "d"), ("b",), ("e",)], number=2)
    {'a': 0, 'c': 0, 'd': 0, 'b': 1, 'e': 1}
    """
    sizes = [0] * number
    folds = {}
    for group in sorted(groups, key=lambda group: (-len(group), group)):
        fold = sizes.index(min(sizes))
        sizes[fold] += len(group)
        folds.update(dict.fromkeys(group, fold))
    return folds


def list_contents(data: Dataset, scene: str) -> Iterator[Hashable]:
    """Yield the contents of each larger room of a scene: counts of classes and categories."""
    cells, others = data.cells(scene), data.others(scene)
    for room in range(1, len(cells)):
        if cells[room].sum() + others.cells[room].sum() >= LEAST_THINGS:
            counted = zip(others.categories, others.cells[room].tolist(), strict=True)
            outside = frozenset((name, count) for name, count in counted if count)
            yield cells[room].tobytes(), outside


def train(config: RunConfig, data: Dataset, folder: Path, *, fold: int) -> Path:
    """Train a model without one fold, unless the run is finished; return the run."""
    run = run_of(folder, config.name, fold)
    fitted = config.model_copy(
        update={"data": config.data.model_copy(update={"fold": fold})},
    )
    if not is_finished(run, fitted, data):
        for _ in train_run(fitted, data.path, run, force=True):
            pass
        print(f"trained {run}", flush=True)
    return run


def find_parts(both: Dataset) -> dict[str, set[str]]:
    """Return the scenes of each group of test buildings."""
    parts: dict[str, set[str]] = {HM3D: set(), "BEHAVIOR, homes": set(), "BEHAVIOR, others": set()}
    for scene in both.scene_ids:
        known = both.surroundings(scene)
        home = "homes" if known.building_kinds[0] == "home" else "others"
        parts[HM3D if known.sources[0] == "hm3d" else f"BEHAVIOR, {home}"].add(scene)
    return {name: scenes for name, scenes in parts.items() if scenes}


def open_models(
    name: str, runs: Sequence[Path], both: Dataset, part: set[str]
) -> Iterator[FoldModel]:
    """Yield the model of every fold with those scenes of a group that are in the fold."""
    for fold, run in enumerate(runs):
        scenes = tuple(scene for scene in both.splits[f"fold-{fold}"] if scene in part)
        if scenes:
            model = restore_model(run / BEST, load_checkpoint(run / BEST))
            yield FoldModel(name, fold, both, model, scenes, run)


def rank_unseen(
    folds: Sequence[FoldModel], mask: MaskRecipe, *, draws: int, resamples: int
) -> Bootstrap:
    """Return how well the models of several folds rank rooms by their unseen classes.

    `auroc` is the AUROC of unseen classes: its mean over classes, then over folds.
    """
    weights = SplitWeights([fold.scenes for fold in folds], resamples=resamples, seed=0)
    measured = []
    for number, fold in enumerate(folds):
        stream = Stream(fold.scenes, weights.of_split(number))
        ranking = METRICS["presence_auroc_macro"].start(stream)
        for masked in fold.stream(mask, draws=draws):
            found = predict_all(fold.model, masked)
            ranking.add(stream.batch(Prediction(read_truth(masked), found)))
        values, key = ranking.finish(), ("rooms", "unseen")
        measured.append(Measured({"auroc": values.values[key]}, {"auroc": values.nodes[key]}))
    return weights.average(measured).bootstrap()


def conclude(found: dict[str, dict[str, Bootstrap]]) -> tuple[str, ...]:
    """Return what training on both changes in each group, compared with HM3D alone."""
    sentences: list[str] = []
    better: list[str] = []
    worse: list[str] = []
    for part in found[BOTH]:
        both, alone = found[BOTH][part], found[HM3D][part]
        changes = []
        for name, what in (("nll", "NLL"), ("auroc", "unseen AUROC")):
            gap = both.difference(alone, name)
            told = "" if is_told_apart(gap) else ", not distinguishable from 0"
            changes.append(f"{what} {format_estimate(gap, signed=True)}{told}")
        sentences.append(f"- {part}: {'; '.join(changes)}.")
        gap = both.difference(alone, "nll")
        if is_told_apart(gap):
            (better if gap.value < 0 else worse).append(part)
    said = [
        f"{how} the hidden NLL on {' and on '.join(parts)}"
        for how, parts in (("lowers", better), ("raises", worse))
        if parts
    ] or ["does not change the hidden NLL by more than chance"]
    first = f"Training on both sources instead of HM3D alone {' and '.join(said)}."
    return (first, "The changes:\n\n" + "\n".join(sentences))


def tabulate(found: dict[str, dict[str, Bootstrap]], name: str) -> tuple[tuple[str, ...], ...]:
    """Return a row for each training, a column for each group of test buildings."""
    return tuple(
        (trained, *(format_estimate(one.estimate(name)) for one in by_part.values()))
        for trained, by_part in found.items()
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Train, measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hm3d", type=Path, required=True, help="dataset of bsg-data build")
    parser.add_argument("--behavior", type=Path, required=True, help="of the same class space")
    parser.add_argument("--runs", type=Path, required=True, help="folder for datasets and runs")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--model", default="universal", help="name of the zoo")
    parser.add_argument("--epochs", type=int, help="default: those of the model")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--mask", default="explore", help="of the test buildings")
    parser.add_argument("--draws", type=int, default=5, help="masks of every building")
    parser.add_argument("--resamples", type=int, default=1000)
    options = parser.parse_args(argv)
    settings = [] if options.epochs is None else [f"training.epochs={options.epochs}"]
    tables = override(find_config(options.model).model_dump(mode="json"), settings)
    config = validate_config(tables, source=options.model)
    data = prepare(
        {HM3D: options.hm3d, BEHAVIOR: options.behavior},
        options.runs,
        folds=options.folds,
        seed=options.seed,
    )
    parts = find_parts(data[BOTH])
    mask = MaskRecipe(strategy=options.mask, seed=options.seed)
    found: dict[str, dict[str, Bootstrap]] = {}
    for name, folder in TRAINED.items():
        runs = [
            train(config, data[name], options.runs / folder, fold=fold)
            for fold in range(options.folds)
        ]
        found[name] = {}
        for part, scenes in parts.items():
            folds = tuple(open_models(name, runs, data[BOTH], scenes))
            likelihood = bootstrap(
                measure_models(iter(folds), tally_likelihood, mask=mask, draws=options.draws),
                resamples=options.resamples,
            )
            ranking = rank_unseen(folds, mask, draws=options.draws, resamples=options.resamples)
            found[name][part] = Bootstrap(
                likelihood.point | ranking.point,
                likelihood.resampled | ranking.resampled,
                likelihood.nodes | ranking.nodes,
            )
            print(f"measured {name} on {part}", flush=True)
    header = ("trained on", *(f"{part} ({len(scenes)})" for part, scenes in parts.items()))
    tested = (
        f"Less is better. Model: `{options.model}`; {options.draws} `{options.mask}` masks of "
        "every building; 95 % intervals over buildings. A column is a group of test buildings, "
        "with their number."
    )
    tables = (
        ResultsTable(
            "Hidden NLL over the classes of all rooms",
            header,
            tabulate(found, "nll"),
            tested,
        ),
        ResultsTable(
            "AUROC of the unseen classes of a room",
            header,
            tabulate(found, "auroc"),
            "More is better. Mean over the classes, then over the folds.",
        ),
    )
    page = ResultsPage(
        "Training on one source, testing on another",
        conclude(found),
        tables,
        describe(data[BOTH], [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
