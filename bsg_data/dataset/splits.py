"""Assign buildings to splits or folds; each building is in exactly one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bsg_data.dataset.manifest import FileEntry, Manifest, read_manifest, require_current
from bsg_data.dataset.revision import revise
from bsg_data.dataset.schema import SPLIT_NAME, SPLITS
from bsg_data.dataset.shards import describe_file, open_parquet, read_table
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.recipes import SplitRecipe

NAMES = ("train", "val", "test")


def assign_splits(
    scenes: Mapping[str, str | None],
    recipe: SplitRecipe,
    *,
    sources: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Assign every scene to a split; every source gets its share of each split.

    Args:
        scenes: scene id → the source's own split; only `official` reads it.
        recipe: method, seed, ratios or folds.
        sources: scene id → source; None if all scenes have the same source.

    Returns:
        Scene id → split, sorted by scene id. It depends only on the set of ids and the recipe.

    Raises:
        RecipeError: if a split would be empty.
    """
    ids = sorted(scenes)
    strata: dict[str, list[str]] = {}
    for scene in ids:
        strata.setdefault("" if sources is None else sources[scene], []).append(scene)
    if recipe.method == "folds":
        chosen = _deal(list(strata.values()), recipe)
    elif recipe.method == "official":
        held = [scene for scene in ids if scenes[scene] in ("val", "minival")]
        rest = [scene for scene in ids if scenes[scene] == "train"]
        if not held or len(held) + len(rest) < len(ids):
            found = Counter(str(split) for split in scenes.values())
            raise RecipeError(
                "an official split needs scenes of the source's train and val splits only; "
                f"found {', '.join(f'{n} of {name}' for name, n in sorted(found.items()))}. "
                "Split by ratios or folds instead"
            )
        chosen = {**_cut([rest], recipe), **dict.fromkeys(held, "test")}
    else:
        chosen = _cut(list(strata.values()), recipe)
    return {scene: chosen[scene] for scene in ids}


def split_dataset(dataset: AnyPath, recipe: SplitRecipe, *, force: bool = False) -> Manifest:
    """Write `splits.parquet` into a dataset and return its new manifest.

    Raises:
        RecipeError: if a split would be empty.
        DatasetError: if there is a split already and `force` is not set. `force` replaces it and
            removes the pairs made from it.
    """
    dataset = Path(dataset)

    def write(manifest: Manifest, folder: Path) -> Manifest:
        require_current(manifest, dataset)
        if manifest.split is not None and not force:
            raise DatasetError(
                f"{dataset}: is split already; --force makes a new split and removes the old one "
                "and its pairs"
            )
        columns = ["scene_id", "source_split", "source"]
        scenes = read_table(dataset, "scenes", columns=columns, manifest=manifest).to_pydict()
        own, sources = (
            dict(zip(scenes["scene_id"], scenes[name], strict=True)) for name in columns[1:]
        )
        chosen = assign_splits(own, recipe, sources=sources)
        entry = _write_file(folder, manifest, recipe, chosen)
        return manifest.without_split().with_table("splits", (entry,), split=recipe)

    return revise(dataset, write)


def assign_folds(dataset: Path, folds: Mapping[str, int], *, number: int) -> Manifest:
    """Write given folds into a dataset, and return its new manifest.

    They replace an existing split and its pairs. The stored recipe has the number of folds, but it
    would assign the buildings differently.

    Args:
        dataset: folder of the dataset.
        folds: scene id → fold, 0 to `number` - 1, for every scene of the dataset.
        number: number of folds.

    Raises:
        RecipeError: if a scene has no fold, a fold has no scene, or a fold is out of range.
    """
    recipe = SplitRecipe(method="folds", ratios=None, folds=number)

    def write(manifest: Manifest, folder: Path) -> Manifest:
        require_current(manifest, dataset)
        columns = ["scene_id"]
        scenes = read_table(dataset, "scenes", columns=columns, manifest=manifest)["scene_id"]
        ids = sorted(scenes.to_pylist())
        without = [scene for scene in ids if scene not in folds]
        if without:
            raise RecipeError(f"{dataset}: scene {without[0]} has no fold; give every scene one")
        found = {folds[scene] for scene in ids}
        if found != set(range(number)):
            raise RecipeError(
                f"{dataset}: expected scenes in each of the folds 0 to {number - 1}, found them in "
                f"{', '.join(map(str, sorted(found)))}"
            )
        chosen = {scene: f"fold-{folds[scene]}" for scene in ids}
        entry = _write_file(folder, manifest, recipe, chosen)
        return manifest.without_split().with_table("splits", (entry,), split=recipe)

    return revise(dataset, write)


def write_splits(
    dataset: Path, folder: Path, manifest: Manifest, *, old: Manifest
) -> list[FileEntry]:
    """Write the splits of a dataset, whose manifest is `old`, into another folder."""
    if manifest.split is None:
        return []
    splits = read_splits(dataset, manifest=old)
    chosen = {scene: name for name, scenes in splits.items() for scene in scenes}
    return [_write_file(folder, manifest, manifest.split, dict(sorted(chosen.items())))]


def _write_file(
    folder: Path, manifest: Manifest, recipe: SplitRecipe, chosen: dict[str, str]
) -> FileEntry:
    """Write `splits.parquet` into a folder."""
    table = pa.Table.from_pydict(
        {"scene_id": list(chosen), "split": list(chosen.values())}, schema=SPLITS
    )
    with open_parquet(
        folder / "splits.parquet",
        SPLITS,
        table="splits",
        class_space=manifest.class_space,
        split=recipe.model_dump_json(),
    ) as writer:
        writer.write_table(table)
    return describe_file(folder, "splits.parquet", rows=len(table))


def read_splits(
    dataset: AnyPath, *, manifest: Manifest | None = None
) -> dict[str, tuple[str, ...]]:
    """Return split → scene ids, with train, val and test first.

    Raises:
        DatasetError: if the dataset has no split yet, or a split has an impossible name.
    """
    dataset = Path(dataset)
    manifest = manifest or read_manifest(dataset)
    if manifest.split is None:
        raise DatasetError(f"{dataset}: is not split yet; run `bsg-data split {dataset}` first")
    table = read_table(dataset, "splits", manifest=manifest).to_pydict()
    splits: dict[str, list[str]] = {}
    for scene, split in zip(table["scene_id"], table["split"], strict=True):
        if not (isinstance(split, str) and SPLIT_NAME.fullmatch(split)):
            raise DatasetError(
                f"{dataset / 'splits.parquet'}: {scene} is in split {split!r}; expected train, "
                "val, test or fold-N. Split again with --force"
            )
        splits.setdefault(split, []).append(scene)
    return {name: tuple(splits[name]) for name in sorted(splits, key=_rank)}


def _rank(split: str) -> tuple[int, int, str]:
    """Return the sort key of a split; its name was checked against `SPLIT_NAME`."""
    if split in NAMES:
        return (NAMES.index(split), 0, split)
    return (len(NAMES), int(split.removeprefix("fold-")), split)


def _shuffle(ids: list[str], seed: int) -> list[str]:
    order = np.random.Generator(np.random.PCG64(seed)).permutation(len(ids))
    return [ids[i] for i in order]


def _deal(strata: Sequence[list[str]], recipe: SplitRecipe) -> dict[str, str]:
    """Assign the shuffled scenes to the folds in turn; sizes differ by at most one.

    The strata follow one another, so the sizes differ by at most one within each of them, too.
    """
    shuffled = [scene for ids in strata for scene in _shuffle(ids, recipe.seed)]
    if recipe.folds is None or not 2 <= recipe.folds <= len(shuffled):
        raise RecipeError(
            f"folds: expected 2 to the number of scenes, {len(shuffled)}; found {recipe.folds}"
        )
    return {scene: f"fold-{i % recipe.folds}" for i, scene in enumerate(shuffled)}


def _cut(strata: Sequence[list[str]], recipe: SplitRecipe) -> dict[str, str]:
    """Cut the shuffled scenes of each stratum by the ratios, apportioned by largest remainder."""
    ratios = np.array(recipe.ratios or ())
    if not ((ratios >= 0) & (ratios <= 1)).all() or abs(ratios.sum() - 1) > 1e-9:
        raise RecipeError(
            f"ratios: expected three numbers of 0 or more that add up to 1; found {recipe.ratios}"
        )
    chosen: dict[str, str] = {}
    for ids in strata:
        names = np.repeat(NAMES, _apportion(len(ids), ratios))
        chosen.update(zip(_shuffle(ids, recipe.seed), map(str, names), strict=True))
    held = set(chosen.values())
    empty = [name for name, ratio in zip(NAMES, ratios, strict=True) if ratio and name not in held]
    if empty:
        raise RecipeError(
            f"{len(chosen)} scenes with ratios {recipe.ratios} leave {' and '.join(empty)} empty; "
            "take more scenes or other ratios"
        )
    return chosen


def _apportion(number: int, ratios: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return how many of some scenes each split gets, by largest remainder."""
    quotas = ratios * number
    sizes = np.floor(quotas + 1e-9).astype(np.int64)
    by_remainder = np.argsort(-(quotas - sizes).round(9), kind="stable")
    sizes[by_remainder[: number - sizes.sum()]] += 1
    return sizes
