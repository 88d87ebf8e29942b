"""Check the scenes of each part, of all parts together, and their splits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from bsg_data.arrays import Bools, Ints
from bsg_data.checks.part import NULL, Fault, Part, Rows
from bsg_data.dataset.manifest import MANIFEST, Manifest, Totals
from bsg_data.dataset.splits import assign_splits
from bsg_data.errors import RecipeError
from bsg_data.recipes import SplitRecipe
from bsg_data.scene.scene_graph import building_hash, is_scene_id


def check_scenes(part: Part) -> Iterator[Fault]:
    """Check the order and the numbering of the rows, and the counts that scenes state."""
    for name in ("rooms", "objects", "edges"):
        scene = getattr(part, name).scene
        if (scene == NULL).any() or (np.diff(scene) < 0).any():
            yield Fault(name, f"part {part.number} has rows of other scenes, or in another order")
    classified = ~np.isnan(part.objects.numbers("class_index"))
    for column, scene in (
        ("num_rooms", part.rooms.scene),
        ("num_objects", part.objects.scene),
        ("num_classified", part.objects.scene[classified]),
    ):
        counted = _count_rows(scene, scenes=len(part.scenes))
        stated = part.scenes.integers(column)
        for row in np.flatnonzero(stated != counted):
            found = f"{column}: expected {counted[row]}, found {stated[row]}"
            yield Fault("scenes", f"{part.scene_ids[row]}: {found}")
    rooms, region = part.rooms, part.rooms.integers("region_id")
    falls = region < 0
    falls[1:] |= (np.diff(rooms.scene) == 0) & (np.diff(region) <= 0)
    for scene in part.name_scenes(rooms, falls):
        yield Fault("rooms", f"{scene}: region_id does not rise from 0 or more")
    for name, key in (("rooms", "room_index"), ("objects", "object_index")):
        rows: Rows = getattr(part, name)
        odd = rows.integers(key) != _number_rows(rows.scene, scenes=len(part.scenes))
        for scene in part.name_scenes(rows, odd):
            yield Fault(name, f"{scene}: {key} does not run 1, 2, 3, …")


def _count_rows(scene: Ints, *, scenes: int) -> Ints:
    """Return the number of rows of each scene, `[scenes]`, from the scene of every row."""
    return np.bincount(scene[scene != NULL], minlength=scenes)


def _number_rows(scene: Ints, *, scenes: int) -> Ints:
    """Return the number of every row within its scene, from 1, in any order of rows."""
    order = np.argsort(scene, kind="stable")
    first = np.searchsorted(scene[order], np.arange(NULL, scenes))
    places = np.empty(len(scene), dtype=np.int64)
    places[order] = np.arange(1, len(scene) + 1) - first[scene[order] - NULL]
    return places


def repeats(scene: Ints, *keys: Ints) -> Bools:
    """Say for every row whether an earlier row has the same scene and keys, `[n]`."""
    columns = (*keys, scene)
    order = np.lexsort(columns)  # stable: equal rows keep their order
    alike = np.ones(max(len(scene) - 1, 0), dtype=bool)
    for column in columns:
        alike &= np.diff(column[order]) == 0
    again = np.zeros(len(scene), dtype=bool)
    again[order[1:]] = alike
    return again


_TABLES = ("rooms", "objects", "edges")


class Census:
    """The scenes of a dataset, counted part by part.

    Attributes:
        source: scene id → source, in the order of the tables.
        source_split: scene id → the source's own split; None if the source has none.
        totals: sums over the scenes.
    """

    def __init__(self) -> None:
        """Start without scenes."""
        self.source: dict[str, str] = {}
        self.source_split: dict[str, str | None] = {}
        self.totals = Totals()
        self._buildings: set[str] = set()
        self._placed: set[str] = set()
        self._strangers: dict[tuple[str, str], None] = {}
        self._last = ""

    def add(self, part: Part) -> Iterator[Fault]:
        """Add a part, and yield the faults of its scenes and of their order."""
        scenes = part.scenes
        sources, splits = scenes.words("source"), scenes.words("source_split")
        no_mesh = scenes.words("up_axis").missing
        for row, scene in enumerate(part.scene_ids):
            yield from self._add_scene(scene)
            self.source[scene] = sources[row] or ""
            self.source_split[scene] = splits[row]
            if not no_mesh[row]:
                self._placed.add(scene)
        for table in _TABLES:
            for scene in getattr(part, table).strangers:
                self._strangers[table, scene] = None
        self._count(part)

    def _add_scene(self, scene: str) -> Iterator[Fault]:
        if scene in self.source:
            yield Fault("scenes", f"{scene} is there twice")
            return
        if not is_scene_id(scene):
            yield Fault("scenes", f"{scene!r} cannot be a scene id: it is no plain file name")
        if scene < self._last:
            yield Fault("scenes", "is not sorted by scene_id")
        building = building_hash(scene)
        if building in self._buildings:
            yield Fault("scenes", f"building {building} has two scene ids")
        self._buildings.add(building)
        self._last = scene

    def _count(self, part: Part) -> None:
        objects = part.objects.table
        found = Totals(
            scenes=len(part.scenes),
            rooms=len(part.rooms),
            objects=len(part.objects),
            classified=len(objects) - objects["class_index"].null_count,
            unmapped=objects["category"].null_count,
            placed=int(part.scenes.flags("has_geometry").sum()),
            adjacent=int(part.edges.words("kind").is_word("adjacent").sum()),
        )
        sums = {name: getattr(self.totals, name) + value for name, value in found}
        self.totals = Totals(**sums)

    def compare(self, manifest: Manifest) -> Iterator[Fault]:
        """Compare all scenes with the manifest, after every part was added."""
        for table, scene in sorted(self._strangers):
            if scene not in self.source:
                yield Fault(table, f"{scene} is no scene of the dataset")
        listed = {source.kind for source in manifest.sources}
        for kind in sorted(set(self.source.values()) ^ listed):
            yield Fault(MANIFEST, f"source {kind} is not in both the manifest and the scenes")
        for name, stated in manifest.totals:
            counted = getattr(self.totals, name)
            if stated != counted:
                yield Fault(MANIFEST, f"totals.{name}: expected {counted}, found {stated}")
        yield from self._compare_meshes(manifest)

    def _compare_meshes(self, manifest: Manifest) -> Iterator[Fault]:
        """Check that the sums of meshes are right, and that their scenes have geometry."""
        for scene in sorted(self._placed.symmetric_difference(manifest.meshes)):
            yield Fault(MANIFEST, f"{scene}: has a mesh in the manifest but no up_axis, or reverse")
        for scene, mesh in manifest.meshes.items():
            if mesh.texels != mesh.listed + mesh.snapped + mesh.black + mesh.unlisted:
                yield Fault(MANIFEST, f"{scene}: the texels of its mesh do not add up")
            parts = mesh.listed_area + mesh.unlisted_area + mesh.uncoloured_area
            if not abs(parts - mesh.area) < 0.01:
                yield Fault(MANIFEST, f"{scene}: the surface of its mesh does not add up")


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
