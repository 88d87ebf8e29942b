"""What must be true of all scenes together: ids, their order, sources, totals and meshes.

It is all that the check remembers of a part when it goes on to the next: a few words a scene.
"""

from __future__ import annotations

from collections.abc import Iterator

from bsg_data.checks.faults import Fault
from bsg_data.checks.part import Part
from bsg_data.dataset.manifest import MANIFEST, Manifest, Totals
from bsg_data.scene.scene_graph import is_scene_id
from bsg_data.scene.scene_id import building_hash

_TABLES = ("rooms", "objects", "edges")


class Census:
    """The scenes of a dataset, counted a part at a time.

    Attributes:
        source: of every scene, by its id, in the order of the tables.
        source_split: the source's own split of every scene, by its id; None where it says none.
        totals: sums over the scenes.
    """

    def __init__(self) -> None:
        """Begin with no scene."""
        self.source: dict[str, str] = {}
        self.source_split: dict[str, str | None] = {}
        self.totals = Totals()
        self._buildings: set[str] = set()
        self._placed: set[str] = set()
        self._strangers: dict[tuple[str, str], None] = {}
        self._last = ""

    def add(self, part: Part) -> Iterator[Fault]:
        """Add a part, and yield what is wrong with its scenes beside those before."""
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
            yield Fault("scenes", f"{scene!r} cannot be a scene id: it would lead out of a folder")
        if scene < self._last:
            yield Fault("scenes", "is not sorted by scene_id")
        building = building_hash(scene)
        if building in self._buildings:
            yield Fault("scenes", f"building {building} is there under two scene ids")
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
        """Compare all scenes, once every part was added, with the manifest."""
        for table, scene in sorted(self._strangers):
            if scene not in self.source:
                yield Fault(table, f"{scene} is no scene of the dataset")
        listed = {source.kind for source in manifest.sources}
        for kind in sorted(set(self.source.values()) ^ listed):
            yield Fault(MANIFEST, f"source {kind} is in the manifest or in the scenes, not in both")
        for name, stated in manifest.totals:
            counted = getattr(self.totals, name)
            if stated != counted:
                yield Fault(MANIFEST, f"totals.{name} is {stated}, {counted} are there")
        yield from self._compare_meshes(manifest)

    def _compare_meshes(self, manifest: Manifest) -> Iterator[Fault]:
        """Check that what meshes cover adds up, and that they are of scenes with geometry."""
        for scene in sorted(self._placed.symmetric_difference(manifest.meshes)):
            yield Fault(MANIFEST, f"{scene}: has a mesh in the manifest or an up_axis, not both")
        for scene, mesh in manifest.meshes.items():
            if mesh.texels != mesh.listed + mesh.snapped + mesh.black + mesh.unlisted:
                yield Fault(MANIFEST, f"{scene}: the texels of its mesh do not add up")
            parts = mesh.listed_area + mesh.unlisted_area + mesh.uncoloured_area
            if not abs(parts - mesh.area) < 0.01:
                yield Fault(MANIFEST, f"{scene}: the surface of its mesh does not add up")
