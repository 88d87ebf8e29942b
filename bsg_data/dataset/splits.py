"""Splits: which building is trained on and which is tested on. A building is in exactly one."""

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
from bsg_data.recipes import SplitRecipe

NAMES = ("train", "val", "test")


def assign_splits(
    scenes: Mapping[str, str | None],
    recipe: SplitRecipe,
    *,
    sources: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Assign every scene to a split, so that each source has its share of every split.

    Args:
        scenes: scene id → the source's own split, which only `official` reads.
        recipe: method, seed, ratios or folds.
        sources: scene id → the source; None where all are of one.

    Returns:
        scene id → split, sorted by scene id. It depends on the set of ids and on the recipe.

    Raises:
        RecipeError: if a split that was asked for would be empty.
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
                "an official split needs scenes of the source's train and val and no others; "
                f"found {', '.join(f'{n} of {name}' for name, n in sorted(found.items()))}. "
                "Split by ratios or folds instead"
            )
        chosen = {**_cut([rest], recipe), **dict.fromkeys(held, "test")}
    else:
        chosen = _cut(list(strata.values()), recipe)
    return {scene: chosen[scene] for scene in ids}


def split_dataset(dataset: Path, recipe: SplitRecipe, *, force: bool = False) -> Manifest:
    """Write `splits.parquet` into a dataset and return its new manifest.

    Raises:
        RecipeError: if a split would be empty.
        DatasetError: if there is a split already and not `force`, which replaces it and removes
            the pairs made from it.
    """

    def write(manifest: Manifest, folder: Path) -> Manifest:
        require_current(manifest, dataset)
        if manifest.split is not None and not force:
            raise DatasetError(
                f"{dataset}: is split already; --force makes a new split and removes the old one "
                "with the pairs made from it"
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
    """Write folds of one's own into a dataset, and return its new manifest.

    They replace a split that is there, with the pairs made from it. The recipe says how many folds
    there are; it would not deal the buildings so.

    Args:
        dataset: its folder.
        folds: scene id → 0 to `number` - 1, of every scene of the dataset.
        number: of folds.

    Raises:
        RecipeError: if a scene has no fold, a fold has no scene, or there is no such fold.
    """
    recipe = SplitRecipe(method="folds", ratios=None, folds=number)

    def write(manifest: Manifest, folder: Path) -> Manifest:
        require_current(manifest, dataset)
        columns = ["scene_id"]
        scenes = read_table(dataset, "scenes", columns=columns, manifest=manifest)["scene_id"]
        ids = sorted(scenes.to_pylist())
        without = [scene for scene in ids if scene not in folds]
        if without:
            raise RecipeError(f"{dataset}: scene {without[0]} has no fold; each must have one")
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


def read_splits(dataset: Path, *, manifest: Manifest | None = None) -> dict[str, tuple[str, ...]]:
    """Read the scene ids of each split, train, val and test first in that order.

    Raises:
        DatasetError: if the dataset is not split yet, or names a split that cannot be.
    """
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
    """Return where a split stands; its name was checked against `SPLIT_NAME`."""
    if split in NAMES:
        return (NAMES.index(split), 0, split)
    return (len(NAMES), int(split.removeprefix("fold-")), split)


def _shuffle(ids: list[str], seed: int) -> list[str]:
    order = np.random.Generator(np.random.PCG64(seed)).permutation(len(ids))
    return [ids[i] for i in order]


def _deal(strata: Sequence[list[str]], recipe: SplitRecipe) -> dict[str, str]:
    """Deal the shuffled scenes to the folds in turn; sizes differ by at most one.

    One stratum follows the other, so that the sizes in each differ by at most one, too.
    """
    shuffled = [scene for ids in strata for scene in _shuffle(ids, recipe.seed)]
    if recipe.folds is None or not 2 <= recipe.folds <= len(shuffled):
        raise RecipeError(
            f"folds must be 2 to the number of scenes, {len(shuffled)}; found {recipe.folds}"
        )
    return {scene: f"fold-{i % recipe.folds}" for i, scene in enumerate(shuffled)}


def _cut(strata: Sequence[list[str]], recipe: SplitRecipe) -> dict[str, str]:
    """Cut the shuffled scenes of each stratum by the ratios, apportioned by largest remainder."""
    ratios = np.array(recipe.ratios or ())
    if not np.isfinite(ratios).all() or (ratios < 0).any() or abs(ratios.sum() - 1) > 1e-9:
        raise RecipeError(
            f"ratios must be three numbers of 0 or more that add up to 1; found {recipe.ratios}"
        )
    chosen: dict[str, str] = {}
    for ids in strata:
        names = np.repeat(NAMES, _apportion(len(ids), ratios))
        chosen.update(zip(_shuffle(ids, recipe.seed), map(str, names), strict=True))
    held = set(chosen.values())
    empty = [name for name, ratio in zip(NAMES, ratios, strict=True) if ratio and name not in held]
    if empty:
        raise RecipeError(
            f"{len(chosen)} scenes cut by {recipe.ratios} leave {' and '.join(empty)} empty; "
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
