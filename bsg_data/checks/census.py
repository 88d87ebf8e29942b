"""Check all scenes of a dataset together: ids, order, sources, totals and meshes.

The check keeps only this between parts: a few words per scene.
"""

from __future__ import annotations

from collections.abc import Iterator

from bsg_data.checks.faults import Fault
from bsg_data.checks.part import Part
from bsg_data.dataset.manifest import MANIFEST, Manifest, Totals
from bsg_data.scene.scene_graph import building_hash, is_scene_id

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
