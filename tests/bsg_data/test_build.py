from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import BEDROOM, KITCHEN, REPOSITORY, annotation_text, write_scene
from killed_process import snapshot
from mesh_files import HOME, write_homes
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import encode_manifest, read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.dataset.statistics import measure_coverage
from bsg_data.errors import (
    ClassMapError,
    DatasetError,
    RecipeError,
    SourceChangedError,
    SourceError,
)
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.source import FoundScenes, Reading, SceneRef


def test_totals_and_losses_of_the_twelve(hm3d_folder: Path, tmp_path: Path) -> None:
    write_scene(hm3d_folder, "00042-broken00000", b"not an annotation")
    write_scene(hm3d_folder, "00005-abcdefghi05", annotation_text({0: KITCHEN}), split="minival")
    manifest = build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out")
    totals = manifest.totals
    bedrooms = sum(range(12))
    assert (totals.scenes, totals.rooms) == (12, 24 + bedrooms)
    assert totals.objects == 12 * (8 + 9 + 2) + 9 * bedrooms
    # a cup is tableware, a book a book; in the kitchen all but wall and floor have a class
    assert totals.classified == 12 * (6 + 5 + 2) + 6 * bedrooms
    assert totals.unmapped == bedrooms
    assert [(u.name, u.instances) for u in manifest.unmapped] == [("zzqx thing", bedrooms)]
    assert manifest.skipped[0].scene_id == "00042-broken00000"
    assert "line 1: expected 'HM3D Semantic Annotations'" in manifest.skipped[0].reason
    assert "another annotation of the same building" in manifest.skipped[1].reason
    assert check_dataset(tmp_path / "out") == ()


class StoppingExecutor(ThreadPoolExecutor):
    """Run some tasks, then behave as if the user had pressed Ctrl-C."""

    def __init__(self, tasks: int) -> None:
        super().__init__(1)
        self.left = tasks

    def submit(self, *args: object, **kwargs: object):  # type: ignore[no-untyped-def, override]
        self.left -= 1
        if self.left < 0:
            self.shutdown(wait=True)
            raise KeyboardInterrupt
        return super().submit(*args, **kwargs)  # type: ignore[arg-type]


def test_a_stopped_build_goes_on_and_makes_damaged_shards_again(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    source, out, partial = HM3DFolder(hm3d_folder), tmp_path / "out", tmp_path / "out.partial"
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    with pytest.raises(KeyboardInterrupt):
        build_dataset(source, out, scenes_per_shard=2, executor=StoppingExecutor(3))
    damaged, *sound = sorted(partial.glob("objects/*"))
    damaged.write_bytes(b"PAR1")
    written = {path: path.stat().st_mtime_ns for path in sound}
    assert len(written) == 2

    def look(done: int, shards: int) -> None:
        if partial.exists():
            assert {path: path.stat().st_mtime_ns for path in sound} == written

    build_dataset(source, out, scenes_per_shard=2, progress=look)
    assert snapshot(out) == snapshot(tmp_path / "whole")
    assert not partial.exists()


class Odd(HM3DFolder):
    """A source of a stranger, whose first scene is odd."""

    def __init__(self, root: Path, *, like: str) -> None:
        super().__init__(root)
        object.__setattr__(self, "like", like)

    def find(self) -> FoundScenes:
        found = super().find()
        first, second, *others = found.scenes
        if self.like == "twice":
            first = replace(first, scene_id=second.scene_id)
        elif self.like == "leads out":
            first = replace(first, scene_id="../secret")
        return replace(found, scenes=(first, second, *others))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        if self.like == "buggy":
            raise KeyError("colour")
        return super().read(ref, class_map)


def test_an_odd_source_is_named(hm3d_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with refuses(SourceError, "scene-twice"):
        build_dataset(Odd(hm3d_folder, like="twice"), out)
    with pytest.raises(RuntimeError, match=r"'hm3d' has a bug: scene 00000-.* raised KeyError"):
        build_dataset(Odd(hm3d_folder, like="buggy"), out)
    with pytest.raises(SourceError, match="must be usable as a file name"):
        build_dataset(Odd(hm3d_folder, like="leads out"), out, strict=True)
    manifest = build_dataset(Odd(hm3d_folder, like="leads out"), out)
    assert [skip.scene_id for skip in manifest.skipped] == ["../secret"]
    assert manifest.totals.scenes == 11


def test_nothing_of_the_users_is_overwritten(
    dataset: Path, hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor a folder of theirs that is called as ours: `.build` is one of Swift's."""
    (tmp_path / "mine" / ".build").mkdir(parents=True)
    (tmp_path / "mine" / ".build" / "notes").write_text("years of work")
    before, source = snapshot(tmp_path), HM3DFolder(hm3d_folder)
    with refuses(DatasetError, "path-taken", dataset):
        build_dataset(source, dataset)
    monkeypatch.chdir(dataset / "scenes")
    for folder, code in (
        (tmp_path / "mine", "path-taken"),
        (dataset / "deeper", "inside-dataset"),
        (dataset, "working-folder"),
        (Path(".."), "working-folder"),
    ):
        with refuses(DatasetError, code):
            build_dataset(source, folder, force=True)
    with pytest.raises(RecipeError):
        build_dataset(source, tmp_path / "new", scenes_per_shard=0)
    write_scene(tmp_path / "root", "00042-broken00000", b"")
    with pytest.raises(SourceError, match=r"no scene could be read: train/00042"):
        build_dataset(HM3DFolder(tmp_path / "root"), tmp_path / "out")
    shutil.rmtree(tmp_path / "root")
    assert before == snapshot(tmp_path)


def test_bytes_do_not_depend_on_where_the_source_is(hm3d_folder: Path, tmp_path: Path) -> None:
    write_scene(hm3d_folder, "00042-broken00000", b"HM3D Semantic Annotations\n1,AB\n")
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "one")
    hm3d_folder.rename(tmp_path / "elsewhere")
    build_dataset(HM3DFolder(tmp_path / "elsewhere"), tmp_path / "two")
    assert snapshot(tmp_path / "one") == snapshot(tmp_path / "two")
    (skip,) = read_manifest(tmp_path / "one").skipped
    assert skip.reason.startswith("line 2: expected id,HEXRGB")


def test_a_linked_out_stays_a_link(hm3d_folder: Path, tmp_path: Path) -> None:
    source, link = HM3DFolder(hm3d_folder), tmp_path / "link"
    link.symlink_to(tmp_path / "disk" / "real")
    (tmp_path / "disk").mkdir()
    for force in (False, True, True):
        build_dataset(source, link, force=force)
        assert link.is_symlink()
        assert check_dataset(tmp_path / "disk" / "real") == ()
    assert sorted(p.name for p in (tmp_path / "disk").iterdir()) == ["real"]


def test_strict_refuses_a_loss_also_of_a_build_that_was_begun(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    source = HM3DFolder(hm3d_folder)
    with pytest.raises(KeyboardInterrupt):
        build_dataset(source, tmp_path / "out", scenes_per_shard=2, executor=StoppingExecutor(3))
    for size in (2, 16):  # shards of the other build are there, or none
        with pytest.raises(ClassMapError, match=r"'zzqx thing' is not in class map hm3d45-v1"):
            build_dataset(source, tmp_path / "out", scenes_per_shard=size, strict=True)


@pytest.mark.heavy
def test_the_real_scenes(shared: Path, tmp_path: Path) -> None:
    text = build_dataset(HM3DFolder(shared / "annotations"), tmp_path / "text")
    source = open_source("hm3d-stats", shared / "HM3DSem-v0.2-train.zip")
    statistics = build_dataset(source, tmp_path / "statistics")
    for manifest in (text, statistics):
        totals = manifest.totals
        assert (totals.scenes, totals.rooms, totals.objects) == (145, 2066, 96110)
        assert (totals.unmapped, manifest.skipped) == (0, ())
    assert (text.totals.classified, statistics.totals.classified) == (40_904, 40_990)  # README
    assert read_manifest(tmp_path / "statistics").sources[0].version == "v0.2"
    found = measure_coverage(Dataset.open(tmp_path / "text"), load_class_map())
    readme = (REPOSITORY / "mappings" / "README.md").read_text("utf-8").split("## Coverage")[1]
    for role in ("structure", "nameless", "classified", "left_out"):
        assert f"{found[role]:,}" in readme
    for share in ("share", "share_of_named"):
        assert f"{found[share]:.1%}".replace("%", " %") in readme


@pytest.fixture(scope="module")
def with_meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two buildings with meshes, the second of which is cut off: only read them."""
    out = tmp_path_factory.mktemp("meshes") / "places"
    write_homes(out, scenes=2)
    mesh = sorted(out.rglob("*.semantic.glb"))[1]
    mesh.write_bytes(mesh.read_bytes()[:-100])
    return out


def test_a_scene_whose_mesh_cannot_be_read_is_kept_without_geometry(
    with_meshes: Path, tmp_path: Path
) -> None:
    """The bytes are the same, whatever the workers."""
    manifest = build_dataset(HM3DFolder(with_meshes), tmp_path / "out", scenes_per_shard=1)
    assert (manifest.totals.scenes, manifest.totals.placed) == (2, 1)
    (left,) = manifest.left_out
    assert left.location.endswith(".semantic.glb")
    assert str(tmp_path) not in encode_manifest(manifest).decode()
    graphs = {graph.scene_id: graph for graph in read_scene_graphs(tmp_path / "out")}
    assert not graphs[left.scene_id].has_geometry
    assert left.scene_id not in manifest.meshes
    with ThreadPoolExecutor(2) as pool:
        build_dataset(HM3DFolder(with_meshes), tmp_path / "many", scenes_per_shard=1, executor=pool)
    assert snapshot(tmp_path / "many") == snapshot(tmp_path / "out")
    with pytest.raises(SourceError):
        build_dataset(HM3DFolder(with_meshes), tmp_path / "strict", strict=True)


def test_a_home_is_where_it_was_painted_whatever_axis_is_up(tmp_path: Path) -> None:
    write_homes(tmp_path / "homes", scenes=2)
    manifest = build_dataset(HM3DFolder(tmp_path / "homes"), tmp_path / "out")
    assert check_dataset(tmp_path / "out") == ()
    for graph, up_axis in zip(read_scene_graphs(tmp_path / "out"), "yz", strict=True):
        assert graph.up_axis == up_axis
        for obj, (name, region, low, *sides) in zip(graph.objects, HOME, strict=True):
            assert (obj.raw_category, obj.room_index) == (name, region + 1)
            ends = np.array([low, np.sum([low, *sides], axis=0)])
            np.testing.assert_allclose([obj.box.minimum, obj.box.maximum], ends, atol=1e-4)
            assert obj.area == pytest.approx(np.linalg.norm(np.cross(*sides)), rel=1e-4)
        assert [(edge.source, edge.target, edge.method) for edge in graph.adjacency] == [
            (1, 2, "door")
        ]
        mesh = manifest.meshes[graph.scene_id]
        assert (mesh.texels, mesh.listed, mesh.listed_area) == (8, 8, mesh.area)


# A source that fails, goes away or changes while it is read: no scene is skipped for that.


def change(path: Path) -> None:
    path.write_text(annotation_text({0: BEDROOM}))


@pytest.mark.parametrize("number", [errno.EIO, errno.EACCES])
def test_an_error_of_the_disk_stops_the_build_and_a_permission_skips_a_scene(
    hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """A permission lacks the next time, too: a build that waited for it would never end."""
    opened = Path.open

    def fail(path: Path, *mode: Any, **options: Any) -> Any:
        if path.name.endswith("07.semantic.txt"):
            raise OSError(number, os.strerror(number))
        return opened(path, *mode, **options)

    monkeypatch.setattr(Path, "open", fail)
    if number == errno.EIO:
        with pytest.raises(SourceChangedError, match=f"{os.strerror(number)}.*no scene was skip"):
            build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out")
        assert not (tmp_path / "out").exists()
        return
    (skip,) = build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out").skipped
    assert skip.reason == "expected a whole file (Permission denied)"


@pytest.mark.parametrize("harm", [Path.unlink, change])
def test_a_source_that_changes_while_it_is_read_stops_the_build(
    hm3d_folder: Path, tmp_path: Path, harm: Callable[[Path], None]
) -> None:
    source, out = HM3DFolder(hm3d_folder), tmp_path / "out"
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    (victim,) = hm3d_folder.rglob("*07.semantic.txt")
    copy = shutil.copy2(victim, tmp_path / "copy")

    def strike(done: int, total: int) -> None:
        if done == 1:
            harm(victim)

    with pytest.raises(SourceChangedError, match=r"07.*no scene was skipped|changed while"):
        build_dataset(source, out, scenes_per_shard=2, progress=strike)
    assert not out.exists()
    shutil.copy2(copy, victim)
    build_dataset(source, out, scenes_per_shard=2)
    assert snapshot(out) == snapshot(tmp_path / "whole")
