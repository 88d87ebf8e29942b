"""Assign buildings to splits or folds; each building is in exactly one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from bsg_data.dataset.commit import name_by_content, update_manifest
from bsg_data.dataset.dataset import NAMES, Dataset
from bsg_data.dataset.manifest import STAGED, Manifest
from bsg_data.dataset.schema import SPLITS
from bsg_data.dataset.shards import write_parquet
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.recipes import SplitRecipe


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
    """
    ids = sorted(scenes)
    strata: dict[str, list[str]] = {}
    for scene in ids:
        strata.setdefault("" if sources is None else sources[scene], []).append(scene)
    held: list[str] = []
    if recipe.method == "official":
        held = [scene for scene in ids if scenes[scene] in ("val", "minival")]
        strata = {"": [scene for scene in ids if scenes[scene] == "train"]}
        if not held or len(held) + len(strata[""]) < len(ids):
            found = Counter(str(split) for split in scenes.values())
            raise RecipeError(
                "an official split needs scenes of the source's train and val splits only; "
                f"found {', '.join(f'{n} of {name}' for name, n in sorted(found.items()))}. "
                "Split by ratios or folds instead"
            )
    shuffled = []
    for stratum in strata.values():
        order = np.random.Generator(np.random.PCG64(recipe.seed)).permutation(len(stratum))
        shuffled.append([stratum[i] for i in order])
    deal = _deal if recipe.method == "folds" else _cut
    chosen = {**deal(shuffled, recipe), **dict.fromkeys(held, "test")}
    return {scene: chosen[scene] for scene in ids}


def split_dataset(dataset: AnyPath, recipe: SplitRecipe, *, force: bool = False) -> Manifest:
    """Split a dataset, and return its new manifest.

    Raises:
        RecipeError: if a split would be empty.
        DatasetError: if there is a split already and `force` is not set. `force` replaces it and
            removes the pairs made from it.
    """
    dataset = Path(dataset)

    def write(data: Dataset) -> Manifest:
        manifest = data.manifest
        if manifest.split is not None and not force:
            raise DatasetError(
                f"{dataset}: is split already; --force makes a new split and removes the old one "
                "and its pairs",
                code="split-exists",
                where=dataset,
            )
        columns = ["scene_id", "source_split", "source"]
        ids, own, sources = data.read_table("scenes", columns=columns).to_pydict().values()
        chosen = assign_splits(
            dict(zip(ids, own, strict=True)), recipe, sources=dict(zip(ids, sources, strict=True))
        )
        staged = write_parquet(
            dataset,
            f"{STAGED}/splits.parquet",
            [pa.table([list(chosen), list(chosen.values())], schema=SPLITS)],
            table="splits",
            class_space=manifest.class_space,
            split=recipe.model_dump_json(),
        )
        entry = name_by_content(dataset, f"splits/{recipe.method}", {"": staged})
        return manifest.without_split().with_table("splits", entry, split=recipe)

    return update_manifest(
        dataset, write, is_made=lambda manifest: manifest.split == recipe and manifest.pairs is None
    )


def _deal(strata: Sequence[list[str]], recipe: SplitRecipe) -> dict[str, str]:
    """Assign the shuffled scenes to the folds in turn; sizes differ by at most one.

    The strata follow one another, so the sizes differ by at most one within each of them, too.
    """
    scenes = [scene for stratum in strata for scene in stratum]
    folds = recipe.folds or 1
    if folds > len(scenes):
        raise RecipeError(f"folds: expected at most one a scene, {len(scenes)}; found {folds}")
    return {scene: f"fold-{i % folds}" for i, scene in enumerate(scenes)}


def _cut(strata: Sequence[list[str]], recipe: SplitRecipe) -> dict[str, str]:
    """Cut the shuffled scenes of each stratum by the ratios, apportioned by largest remainder."""
    ratios = np.array(recipe.ratios)
    chosen: dict[str, str] = {}
    for scenes in strata:
        quotas = ratios * len(scenes)
        sizes = np.floor(quotas + 1e-9).astype(np.int64)
        by_remainder = np.argsort(-(quotas - sizes).round(9), kind="stable")
        sizes[by_remainder[: len(scenes) - sizes.sum()]] += 1
        chosen.update(zip(scenes, np.repeat(NAMES, sizes).tolist(), strict=True))
    held = set(chosen.values())
    empty = [name for name, ratio in zip(NAMES, ratios, strict=True) if ratio and name not in held]
    if empty:
        raise RecipeError(
            f"{len(chosen)} scenes with ratios {recipe.ratios} leave {' and '.join(empty)} empty; "
            "take more scenes or other ratios; 0 0 1 keeps all for testing"
        )
    return chosen
