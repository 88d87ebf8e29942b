"""Splits: which building is trained on and which is tested on. A building is in exactly one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from bsg_data.dataset.manifest import Manifest, read_manifest, require_current
from bsg_data.dataset.revision import revise
from bsg_data.dataset.schema import SPLIT_NAME, SPLITS
from bsg_data.dataset.shards import describe_file, open_parquet, read_table
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.recipes import SplitRecipe

NAMES = ("train", "val", "test")


def assign_splits(scenes: Mapping[str, str | None], recipe: SplitRecipe) -> dict[str, str]:
    """Assign every scene to a split.

    Args:
        scenes: scene id → the source's own split, which only `official` reads.
        recipe: method, seed, ratios or folds.

    Returns:
        scene id → split, sorted by scene id. It depends on the set of ids and on the recipe.

    Raises:
        RecipeError: if a split that was asked for would be empty.
    """
    ids = sorted(scenes)
    if recipe.method == "folds":
        chosen = _deal(ids, recipe)
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
        chosen = {**_cut(rest, recipe), **dict.fromkeys(held, "test")}
    else:
        chosen = _cut(ids, recipe)
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
        columns = ["scene_id", "source_split"]
        scenes = read_table(dataset, "scenes", columns=columns, manifest=manifest).to_pydict()
        own = dict(zip(scenes["scene_id"], scenes["source_split"], strict=True))
        return _write_splits(folder, manifest, recipe, assign_splits(own, recipe))

    return revise(dataset, write)


def _write_splits(
    folder: Path, manifest: Manifest, recipe: SplitRecipe, chosen: dict[str, str]
) -> Manifest:
    """Write `splits.parquet` into a folder and return the manifest with it."""
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
    entry = describe_file(folder, "splits.parquet", rows=len(table))
    return manifest.without_split().with_table("splits", (entry,), split=recipe)


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
    if split in NAMES:
        return (NAMES.index(split), 0, split)
    number = split.removeprefix("fold-")
    return (len(NAMES), int(number) if number.isascii() and number.isdigit() else 0, split)


def _shuffle(ids: list[str], seed: int) -> list[str]:
    order = np.random.Generator(np.random.PCG64(seed)).permutation(len(ids))
    return [ids[i] for i in order]


def _deal(ids: list[str], recipe: SplitRecipe) -> dict[str, str]:
    """Deal the shuffled scenes to the folds in turn; sizes differ by at most one."""
    folds = recipe.folds or 0
    if not 2 <= folds <= len(ids):
        raise RecipeError(f"folds must be 2 to the number of scenes, {len(ids)}; found {folds}")
    return {scene: f"fold-{i % folds}" for i, scene in enumerate(_shuffle(ids, recipe.seed))}


def _cut(ids: list[str], recipe: SplitRecipe) -> dict[str, str]:
    """Cut the shuffled scenes by the ratios, apportioned by largest remainder."""
    ratios = np.array(recipe.ratios or (0.0, 0.0, 0.0))
    if not np.isfinite(ratios).all() or (ratios < 0).any() or abs(ratios.sum() - 1) > 1e-9:
        raise RecipeError(
            f"ratios must be three numbers of 0 or more that add up to 1; found {recipe.ratios}"
        )
    quotas = ratios * len(ids)
    sizes = np.floor(quotas + 1e-9).astype(int)
    by_remainder = np.argsort(-(quotas - sizes).round(9), kind="stable")
    sizes[by_remainder[: len(ids) - sizes.sum()]] += 1
    empty = [
        name for name, ratio, size in zip(NAMES, ratios, sizes, strict=True) if ratio and not size
    ]
    if empty:
        raise RecipeError(
            f"{len(ids)} scenes cut by {recipe.ratios} leave {' and '.join(empty)} empty; "
            "take more scenes or other ratios"
        )
    names = np.repeat(NAMES, sizes)
    return {scene: str(name) for scene, name in zip(_shuffle(ids, recipe.seed), names, strict=True)}
