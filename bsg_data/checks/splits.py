"""Check that splits do not leak, and that they follow from their recipe."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import pyarrow as pa

from bsg_data.checks.census import Census
from bsg_data.checks.faults import Fault
from bsg_data.dataset.splits import assign_splits
from bsg_data.errors import RecipeError
from bsg_data.recipes import SplitRecipe
from bsg_data.scene.scene_graph import building_hash


def check_splits(splits: pa.Table, census: Census, recipe: SplitRecipe) -> Iterator[Fault]:
    """Check that every building is in exactly one split, the split of the recipe."""
    scenes, names = splits["scene_id"].to_pylist(), splits["split"].to_pylist()
    for scene, times in sorted(Counter(scenes).items()):
        if times > 1:
            yield Fault("splits", f"{scene} is in two splits or twice in one")
    for scene in sorted(census.source.keys() ^ set(scenes)):
        yield Fault("splits", f"{scene} is not in both scenes and splits")
    found: dict[str, str] = {}
    for scene, split in zip(scenes, names, strict=True):
        building = building_hash(scene)
        if found.setdefault(building, split) != split:
            yield Fault("splits", f"building {building} leaks: it is in more than one split")
    try:
        by_recipe = assign_splits(census.source_split, recipe, sources=census.source)
    except RecipeError as error:
        yield Fault("splits", f"cannot be made by the recipe: {error}")
        return
    for scene, split in zip(scenes, names, strict=True):
        if by_recipe.get(scene, split) != split:
            yield Fault("splits", f"{scene}: expected split {by_recipe[scene]}, found {split}")
