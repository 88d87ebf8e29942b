from __future__ import annotations

import errno
import os
import resource
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import BATHROOM, BEDROOM, KITCHEN, REPOSITORY, annotation_text, write_scene
from painted_meshes import write_painted
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import encode_manifest, read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.dataset.splits import split_dataset
from bsg_data.dataset.statistics import measure_coverage
from bsg_data.errors import (
    ClassMapError,
    DatasetError,
    RecipeError,
    SourceChangedError,
    SourceError,
)
from bsg_data.merge import merge_datasets
from bsg_data.recipes import SplitRecipe
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.source import FoundScenes, Reading, SceneRef


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


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


def test_a_stopped_build_resumes_to_the_same_bytes(hm3d_folder: Path, tmp_path: Path) -> None:
    source = HM3DFolder(hm3d_folder)
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    out = tmp_path / "out"
    stopped: Executor = StoppingExecutor(3)
    with pytest.raises(KeyboardInterrupt):
        build_dataset(source, out, scenes_per_shard=2, executor=stopped)
    partial = tmp_path / "out.partial"
    done = {p: p.stat().st_mtime_ns for p in partial.glob("objects/*")}
    assert len(done) == 3
    assert not out.exists()
    kept = []
    build_dataset(
        source,
        out,
        scenes_per_shard=2,
        progress=lambda n, _: (
            kept.append({p: p.stat().st_mtime_ns for p in done} == done)
            if partial.exists()
            else None
        ),
    )
    assert kept == [True] * 6  # finished shards were not written again
    assert all_bytes(out) == all_bytes(tmp_path / "whole")
    assert not partial.exists()


@pytest.mark.parametrize("damage", ["shard", "source"])
def test_a_changed_source_or_a_damaged_shard_is_made_again(
    hm3d_folder: Path, tmp_path: Path, damage: str
) -> None:
    out, source = tmp_path / "out", HM3DFolder(hm3d_folder)
    with pytest.raises(KeyboardInterrupt):
        build_dataset(source, out, scenes_per_shard=2, executor=StoppingExecutor(3))
    if damage == "shard":
        (tmp_path / "out.partial" / "objects" / "part-00001.parquet").write_bytes(b"PAR1")
    else:
        write_scene(hm3d_folder, "00000-abcdefghi00", annotation_text({0: [*KITCHEN, "bed"]}))
    build_dataset(source, out, scenes_per_shard=2)
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    assert all_bytes(out) == all_bytes(tmp_path / "whole")


def test_bytes_do_not_depend_on_where_the_source_is(hm3d_folder: Path, tmp_path: Path) -> None:
    write_scene(hm3d_folder, "00042-broken00000", b"HM3D Semantic Annotations\n1,AB\n")
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "one")
    hm3d_folder.rename(tmp_path / "elsewhere")
    build_dataset(HM3DFolder(tmp_path / "elsewhere"), tmp_path / "two")
    assert all_bytes(tmp_path / "one") == all_bytes(tmp_path / "two")
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


def test_nothing_of_the_users_is_overwritten(hm3d_folder: Path, tmp_path: Path) -> None:
    source = HM3DFolder(hm3d_folder)
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    with pytest.raises(DatasetError, match="exists and is no dataset"):
        build_dataset(source, mine, force=True)
    assert (mine / "thesis.tex").read_text() == "years of work"
    (tmp_path / "out.partial").mkdir()
    (tmp_path / "out.partial" / "thesis.tex").write_text("years of work")
    with pytest.raises(DatasetError, match="which is not ours"):
        build_dataset(source, tmp_path / "out")
    (tmp_path / "out.partial" / "thesis.tex").unlink()  # what is empty is nobody's
    build_dataset(source, tmp_path / "out")
    before = all_bytes(tmp_path / "out")
    with pytest.raises(DatasetError, match="--force replaces it"):
        build_dataset(source, tmp_path / "out")
    with pytest.raises(DatasetError, match="is in the dataset"):
        build_dataset(source, tmp_path / "out" / "deeper")
    with pytest.raises(SourceError):
        build_dataset(HM3DFolder(tmp_path / "none"), tmp_path / "out", force=True)
    assert all_bytes(tmp_path / "out") == before
    build_dataset(source, tmp_path / "out", force=True)
    assert all_bytes(tmp_path / "out") == before


def test_strict_refuses_a_loss_also_of_a_build_that_was_begun(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    source = HM3DFolder(hm3d_folder)
    with pytest.raises(KeyboardInterrupt):
        build_dataset(source, tmp_path / "out", scenes_per_shard=2, executor=StoppingExecutor(3))
    for size in (2, 16):  # shards of the other build are there, or none
        with pytest.raises(ClassMapError, match=r"'zzqx thing' is not in class map hm3d45-v1"):
            build_dataset(source, tmp_path / "out", scenes_per_shard=size, strict=True)


def test_a_scene_whose_id_leads_out_of_a_folder_is_left_out(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    class Hostile(HM3DFolder):
        def find(self) -> FoundScenes:
            found = super().find()
            first = replace(found.scenes[0], scene_id="../secret")
            return replace(found, scenes=(first, *found.scenes[1:]))

    manifest = build_dataset(Hostile(hm3d_folder), tmp_path / "out")
    (skip,) = manifest.skipped
    assert skip.scene_id == "../secret"
    assert "must be usable as a file name" in skip.reason
    assert manifest.totals.scenes == 11
    with pytest.raises(SourceError, match="must be usable as a file name"):
        build_dataset(Hostile(hm3d_folder), tmp_path / "strict", strict=True)


def test_two_scenes_whose_names_differ_in_digits_are_two_buildings(tmp_path: Path) -> None:
    rows = [f"0000{n}-flat,kitchen,{thing}\n" for n in (1, 2) for thing in ("stove", "sink")]
    (tmp_path / "objects.csv").write_text("".join(["scene,room,category\n", *rows]))
    manifest = build_dataset(open_source("table", tmp_path / "objects.csv"), tmp_path / "out")
    assert (manifest.totals.scenes, manifest.skipped) == (2, ())


def test_two_annotations_of_one_building_are_said_and_an_error_under_strict(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    copy = next(hm3d_folder.rglob("*00.semantic.txt"))
    other = write_scene(hm3d_folder, "00000-abcdefghi00", copy.read_bytes(), split="minival")
    known = tmp_path / "known.csv"
    names = ["stove", *{name for room in (KITCHEN, BEDROOM, BATHROOM) for name in room}]
    rows = "".join(f"{name},{name},\n" for name in dict.fromkeys(filter(None, names)))
    known.write_text(f"raw_category,category,class\n{rows}book,book,\ncup,cup,\n")
    source = HM3DFolder(hm3d_folder)
    manifest = build_dataset(source, tmp_path / "same", class_map=known, strict=True)
    assert "has the same annotation" in manifest.skipped[0].reason
    other.write_text(annotation_text({0: KITCHEN}))
    manifest = build_dataset(source, tmp_path / "other", class_map=known)
    assert "has another annotation of the same building" in manifest.skipped[0].reason
    with refuses(SourceError, "scene-unreadable", other):
        build_dataset(source, tmp_path / "strict", class_map=known, strict=True)


def test_two_scenes_of_one_id_are_refused(tmp_path: Path) -> None:
    text = annotation_text({0: KITCHEN})
    write_scene(tmp_path / "hm3d", "00006-HkseAnWCgqk", text)
    other = tmp_path / "hm3d" / "flat" / "00006-HkseAnWCgqk.semantic.txt"
    other.parent.mkdir()
    other.write_text(text)
    manifest = build_dataset(HM3DFolder(tmp_path / "hm3d"), tmp_path / "out")
    assert (manifest.totals.scenes, len(manifest.skipped)) == (1, 1)

    class Twice(HM3DFolder):
        def find(self) -> FoundScenes:
            (ref,) = super().find().scenes
            return FoundScenes((ref, replace(ref, building="another")))

    with refuses(SourceError, "scene-twice", "00006-HkseAnWCgqk"):
        build_dataset(Twice(tmp_path / "hm3d"), tmp_path / "twice")


def test_folders_of_the_users_that_are_called_as_ours_are_left_alone(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    """`.build` is a folder of Swift's, and anybody's folder may end in `.partial`."""
    out = tmp_path / "out"
    for path in (out / ".build" / "notes", tmp_path / "out.partial" / "thesis.tex"):
        path.parent.mkdir(parents=True)
        path.write_text("years of work")
    with pytest.raises(DatasetError, match="exists and is no dataset"):
        build_dataset(HM3DFolder(hm3d_folder), out, force=True)
    (tmp_path / "out.partial" / "thesis.tex").rename(tmp_path / "thesis.tex")
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "other")
    (tmp_path / "other" / ".build").mkdir()
    shutil.copy(out / ".build" / "notes", tmp_path / "other" / ".build" / "notes")
    split_dataset(tmp_path / "other", SplitRecipe())
    assert (tmp_path / "other" / ".build" / "notes").read_text() == "years of work"
    assert (out / ".build" / "notes").read_text() == "years of work"


def test_labels_of_rooms_that_nobody_knows_are_reported(tmp_path: Path) -> None:
    """Other words for no kind of room, and numbers, are nothing to be known."""
    rooms = ["Kajüte", "Kajüte 2", "Vorschiff", "kitchen", "R7", "other"]
    rows = [f"flat,{room},chair\n" for room in rooms]
    (tmp_path / "objects.csv").write_text("".join(["scene,room,category\n", *rows]))
    manifest = build_dataset(open_source("table", tmp_path / "objects.csv"), tmp_path / "out")
    assert {one.name: one.instances for one in manifest.unknown_labels} == {
        "Kajüte": 1,
        "Kajüte 2": 1,
        "Vorschiff": 1,
    }


def test_an_empty_result_is_a_failure(tmp_path: Path) -> None:
    write_scene(tmp_path / "root", "00042-broken00000", b"")
    with pytest.raises(SourceError, match=r"no scene could be read: train/00042"):
        build_dataset(HM3DFolder(tmp_path / "root"), tmp_path / "out")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["root"]


def test_a_shard_of_no_scenes_is_refused_at_once(hm3d_folder: Path, tmp_path: Path) -> None:
    with pytest.raises(RecipeError):
        build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out", scenes_per_shard=0)
    assert not list(tmp_path.glob("*out*"))


def _limit_file_size() -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2500, 2500))


def test_a_disk_that_fills_up_is_reported_and_the_build_goes_on_later(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    """A file that cannot grow stands for a full disk: the write fails in the same place."""
    code = "from bsg_cli.data import main; main()"
    command = [sys.executable, "-c", code, "build", "--workers", "1"]
    command += ["--hm3d", str(hm3d_folder), "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=_limit_file_size)
    assert done.returncode == 1
    assert "cannot be written" in done.stderr
    assert "File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
    assert not list((tmp_path / "out.partial").rglob("*.partial"))
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out")
    assert check_dataset(tmp_path / "out") == ()


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
    write_painted(out, scenes=2, seed=1)
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
    assert all_bytes(tmp_path / "many") == all_bytes(tmp_path / "out")
    with pytest.raises(SourceError):
        build_dataset(HM3DFolder(with_meshes), tmp_path / "strict", strict=True)


def test_a_bug_of_a_source_names_the_scene(hm3d_folder: Path, tmp_path: Path) -> None:
    class Buggy(HM3DFolder):
        def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
            if ref.scene_id.endswith("05"):
                raise KeyError("colour")
            return super().read(ref, class_map)

    with pytest.raises(RuntimeError, match=r"'hm3d' has a bug: scene 00005-.* raised KeyError"):
        build_dataset(Buggy(hm3d_folder), tmp_path / "out")


@pytest.mark.parametrize(("stand", "name"), [("", "."), ("scenes", "OUT")])
def test_the_folder_that_the_shell_stands_in_is_not_replaced(
    hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stand: str, name: str
) -> None:
    out = tmp_path / "out"
    build_dataset(HM3DFolder(hm3d_folder), out)
    before = all_bytes(out)
    monkeypatch.chdir(out / stand)
    with pytest.raises(DatasetError, match="run this from another folder"):
        build_dataset(HM3DFolder(hm3d_folder), name.replace("OUT", str(out)), force=True)
    assert all_bytes(out) == before
    assert [path.name for path in tmp_path.glob("*out*")] == ["out"]
    monkeypatch.chdir(tmp_path)
    build_dataset(HM3DFolder(hm3d_folder), "out", force=True)
    assert all_bytes(out) == before


# A source that fails, goes away or changes while it is read: no scene is skipped for that.


def change(path: Path) -> None:
    path.write_text(annotation_text({0: BEDROOM}))


def grow(path: Path) -> None:
    os.truncate(path, 10 * 2**30)  # sparse: it takes no disk


@pytest.mark.parametrize("harm", [Path.unlink, change, grow])
def test_a_scene_that_is_not_what_was_listed_stops_the_build(
    hm3d_folder: Path, tmp_path: Path, harm: Callable[[Path], None]
) -> None:
    source, out = HM3DFolder(hm3d_folder), tmp_path / "out"
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    (victim,) = hm3d_folder.rglob("*07.semantic.txt")
    kept = shutil.copy2(victim, tmp_path / "kept")

    def strike(done: int, total: int) -> None:
        if done == 1:
            harm(victim)

    with pytest.raises(SourceChangedError, match=r"abcdefghi07.*no scene was skipped"):
        build_dataset(source, out, scenes_per_shard=2, progress=strike)
    assert not out.exists()
    shutil.copy2(kept, victim)
    build_dataset(source, out, scenes_per_shard=2)
    assert all_bytes(out) == all_bytes(tmp_path / "whole")


@pytest.mark.parametrize("fails_at", [0, 5])
def test_an_error_of_the_disk_stops_the_build_which_goes_on_later(
    hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails_at: int
) -> None:
    source, out, reads = HM3DFolder(hm3d_folder), tmp_path / "out", [0]
    opened = Path.open

    def fail(path: Path, *mode: Any, **options: Any) -> Any:
        if path.name.endswith(".semantic.txt"):
            reads[0] += 1
            if reads[0] == fails_at + 1:
                raise OSError(errno.EIO, os.strerror(errno.EIO))
        return opened(path, *mode, **options)

    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(SourceChangedError, match=os.strerror(errno.EIO)):
        build_dataset(source, out, scenes_per_shard=2)
    assert not out.exists()
    monkeypatch.undo()
    build_dataset(source, out, scenes_per_shard=2)
    build_dataset(source, tmp_path / "whole", scenes_per_shard=2)
    assert all_bytes(out) == all_bytes(tmp_path / "whole")


def test_a_file_that_may_not_be_read_is_skipped_and_named(
    hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is so the next time, too: a build that waits for a permission would never end."""
    opened = Path.open

    def fail(path: Path, *mode: Any, **options: Any) -> Any:
        if path.name.endswith("07.semantic.txt"):
            raise PermissionError(errno.EACCES, "Permission denied")
        return opened(path, *mode, **options)

    monkeypatch.setattr(Path, "open", fail)
    manifest = build_dataset(HM3DFolder(hm3d_folder), tmp_path / "out")
    (skip,) = manifest.skipped
    assert (manifest.totals.scenes, skip.scene_id[-2:]) == (11, "07")
    assert skip.reason == "cannot be read (Permission denied)"


def test_a_table_that_is_written_anew_stops_the_build(tmp_path: Path) -> None:
    table = tmp_path / "objects.csv"
    rows = [f"scene-{k},room,chair\n" for k in range(4)]
    for then in ("".join(["scene,room,category\n", *rows[:2]]), "scene,room\n", "no table"):
        table.write_text("".join(["scene,room,category\n", *rows]))

        def strike(done: int, total: int, then: str = then) -> None:
            table.write_text(then)

        source = open_source("table", table)
        with pytest.raises(SourceChangedError, match="no scene was skipped"):
            build_dataset(source, tmp_path / "out", scenes_per_shard=1, progress=strike)


def test_parts_that_are_built_apart_merge_to_the_tables_of_one_build(
    hm3d_folder: Path, tmp_path: Path
) -> None:
    """Each job of a queue builds a dataset of its own; nothing else is shared."""
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "whole")
    for number, scene in enumerate(sorted(hm3d_folder.glob("*/*"))):
        place = tmp_path / f"part-{number % 3}" / scene.parent.name / scene.name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(scene)
    parts = [tmp_path / f"dataset-{number}" for number in range(3)]
    for number, part in enumerate(parts):
        build_dataset(HM3DFolder(tmp_path / f"part-{number}"), part)
    merge_datasets(parts, tmp_path / "merged")
    for table in ("scenes", "rooms", "objects", "edges"):
        name = f"{table}/part-00000.parquet"
        found, expected = (tmp_path / out / name for out in ("merged", "whole"))
        assert found.read_bytes() == expected.read_bytes()
    assert read_manifest(tmp_path / "merged") == read_manifest(tmp_path / "whole")
    assert check_dataset(tmp_path / "merged") == ()
