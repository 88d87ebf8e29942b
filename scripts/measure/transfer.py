"""Measure a model that was trained on one source on buildings of another.

    python scripts/measure/transfer.py --hm3d hm3d --behavior behavior --runs runs --out FIGURES

The script trains the model on HM3D, on BEHAVIOR and on both, in folds by building. It tests each on
the buildings of the held-out fold: those of HM3D, the homes of BEHAVIOR, and the other buildings of
BEHAVIOR. Buildings of BEHAVIOR that share copied rooms are in one fold. Finished runs are kept.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Hashable, Iterator, Mapping, Sequence
from pathlib import Path

import networkx as nx
from folds import FoldModel, measure, tally_likelihood
from results import ResultsTable, format_estimate, write_figures

from bsg_data.dataset.commit import update_manifest
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import MANIFEST
from bsg_data.dataset.splits import assign_splits, write_splits
from bsg_data.merge import merge_datasets
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.runs.checkpoint import is_finished, load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST
from bsg_models.studies.leaderboard import run_of
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
        data = Dataset.open(copy)
        if data.manifest.pairs is None or "fold-0" not in data.splits:  # a split of the source's
            recipe = SplitRecipe(method="folds", ratios=None, folds=folds)
            dealt = {scene: f"fold-{chosen[scene]}" for scene in data.scene_ids}
            update_manifest(
                copy, lambda old, b=recipe, c=dealt: write_splits(old.path, old.manifest, b, c)
            )
            write_pairs(copy, PairsRecipe(mask=MaskRecipe(seed=seed), draws=5), force=True)
        opened[name] = Dataset.open(copy)
    return opened


def group_copies(rooms: Mapping[str, Sequence[Hashable]]) -> list[tuple[str, ...]]:
    """Return the groups of buildings whose rooms have equal contents, also through others.

    >>> group_copies({"a": [1, 2], "b": [3], "c": [2, 4], "d": [4], "e": []})
    [('a', 'c', 'd'), ('b',), ('e',)]
    """
    graph = nx.Graph([(scene, (content,)) for scene in rooms for content in rooms[scene]])
    graph.add_nodes_from(rooms)
    groups = nx.connected_components(graph)
    return sorted(tuple(sorted(group & rooms.keys())) for group in groups)


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
    cells, unclassified = data.cells(scene), data.unclassified(scene)
    for room in range(1, len(cells)):
        if cells[room].sum() + unclassified.cells[room].sum() >= LEAST_THINGS:
            counted = zip(unclassified.categories, unclassified.cells[room].tolist(), strict=True)
            outside = frozenset((name, count) for name, count in counted if count)
            yield cells[room].tobytes(), outside


def train(config: RunConfig, data: Dataset, folder: Path, *, fold: int) -> Path:
    """Train a model without one fold, unless the run is finished; return the run."""
    run = run_of(folder, config.name, fold)
    fitted = config.model_copy(
        update={"data": config.data.model_copy(update={"fold": fold})},
    )
    if not is_finished(run, fitted, data):
        train_run(fitted, data.path, run, force=True)
        print(f"trained {run}", flush=True)
    return run


def find_parts(both: Dataset) -> dict[str, set[str]]:
    """Return the scenes of each group of test buildings."""
    parts: dict[str, set[str]] = {HM3D: set(), "BEHAVIOR, homes": set(), "BEHAVIOR, others": set()}
    for scene in both.scene_ids:
        known = both.surroundings(scene)
        is_home = known.building_kinds[0] == BUILDING_KINDS.index("home")
        is_hm3d = known.sources[0] == KNOWN_SOURCES.index(TRAINED[HM3D])
        other = "BEHAVIOR, homes" if is_home else "BEHAVIOR, others"
        parts[HM3D if is_hm3d else other].add(scene)
    return {name: scenes for name, scenes in parts.items() if scenes}


def open_models(runs: Sequence[Path], both: Dataset, part: set[str]) -> Iterator[FoldModel]:
    """Yield the model of every fold with those scenes of a group that are in the fold."""
    for fold, run in enumerate(runs):
        scenes = tuple(scene for scene in both.splits[f"fold-{fold}"] if scene in part)
        if scenes:
            model = restore_model(run / BEST, load_checkpoint(run / BEST))
            yield FoldModel(fold, both, model, scenes, run)


def tabulate(found: Mapping[str, Mapping[str, Bootstrap]]) -> list[list[str]]:
    """Return a row for each training, a column for each group of test buildings."""
    rows = [
        [trained, *(format_estimate(one.estimate("nll")) for one in by_part.values())]
        for trained, by_part in found.items()
    ]
    gaps = [both.difference(found[HM3D][part], "nll") for part, both in found[BOTH].items()]
    return [*rows, ["both − HM3D", *(format_estimate(gap, signed=True) for gap in gaps)]]


def main(argv: Sequence[str] | None = None) -> int:
    """Train, measure, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hm3d", type=Path, required=True, help="dataset of bsg-data build")
    parser.add_argument("--behavior", type=Path, required=True, help="of the same class space")
    parser.add_argument("--runs", type=Path, required=True, help="folder for datasets and runs")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
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
        found[name] = {
            part: measure(
                open_models(runs, data[BOTH], scenes),
                tally_likelihood,
                mask=mask,
                draws=options.draws,
                resamples=options.resamples,
            )
            for part, scenes in parts.items()
        }
        print(f"measured {name}", flush=True)
    reading = (
        f"Less is better. Model: `{options.model}`; {options.draws} `{options.mask}` masks of "
        "every building; 95 % intervals over buildings. A column is a group of test buildings, "
        "with their number. The last row is a paired difference."
    )
    header = ("trained on", *(f"{part} ({len(scenes)})" for part, scenes in parts.items()))
    table = ResultsTable(
        "Hidden NLL over the classes of all rooms", header, tabulate(found), reading
    )
    write_figures(
        options.out,
        "transfer",
        [table],
        argv=[__file__, *(argv or sys.argv[1:])],
        data=data[BOTH],
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
