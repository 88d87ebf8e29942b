"""Every place where a name that stands in a file could become a path, and how to put one there.

Each place makes its input in a folder of its own, with a name of an attacker's in it, and gives the
commands that read it. The folder lies in `work`, beside `victim`.
"""

from __future__ import annotations

import csv
import json
import shutil
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from click.testing import CliRunner
from conftest import commit_manifest, describe_file, working_in
from dsg_files import robot_graph

from bsg_cli.registry import COMMANDS
from bsg_data.dataset.manifest import MANIFEST, read_manifest
from bsg_data.sources.hm3d_stats import MEMBER
from bsg_models.runs.checkpoint import load_checkpoint, save_checkpoint
from bsg_models.runs.run_folder import BEST

Lines = list[list[str]]
STATISTICS = "Scene Name,Region #,# Unique Categories,# Objects,Object Instances in Region,Category"
LAYOUT = "rooms: {}\n"


@dataclass(frozen=True, slots=True)
class Place:
    """A place for a name.

    Attributes:
        title: what it is called.
        needs: which of `dataset` and `run` are copied into the folder.
        put: makes the input, and returns the commands that read it.
        is_slow: whether it is tried in full alone.
    """

    title: str
    needs: tuple[str, ...]
    put: Callable[[Path, str], Lines]
    is_slow: bool = False


def hostile_names(victim: Path) -> tuple[str, ...]:
    """Return names that lead, or could lead, to a file `evil` of the victim, and odd ones."""
    up = tuple(f"{'../' * depth}{victim.name}/evil" for depth in (1, 2, 3, 4))
    return (
        *up,
        str(victim / "evil"),
        f"file://{victim}/evil",
        f"train/../../../{victim.name}/evil",
        f"..\\..\\{victim.name}\\evil",
        "C:\\victim\\evil",
        "a/b",
        "",
        ".",
        "..",
        "nul\0l",
        "x" * 5_000,
        "-rf",
        "~/evil",
        "$HOME",
        "two\nlines",
        "\u202elive",
    )


def write_victim(folder: Path) -> Path:
    """Make what must not be touched: a file for every suffix that a reader might look for."""
    folder.mkdir()
    beside = ("", ".csv", ".classes.csv", ".yaml", ".json", ".safetensors", ".png", ".parquet")
    for suffix in (*beside, "-00000.parquet"):
        (folder / f"evil{suffix}").write_text("room_label,kitchen\n", "utf-8")
    return folder


def put_into_files(folder: Path, name: str) -> Lines:
    return _edit_manifest(folder, lambda said: said["files"][0].update(path=name))


def put_into_class_map(folder: Path, name: str) -> Lines:
    entry = {"version": name, "sha256": "0" * 64}
    return _read_and_merge(folder, lambda said: said["sources"][0].update(class_map=entry))


def put_into_hash_of_class_map(folder: Path, name: str) -> Lines:
    entry = {"version": "evil", "sha256": name}
    return _read_and_merge(folder, lambda said: said["sources"][0].update(class_map=entry))


def put_into_mask(folder: Path, name: str) -> Lines:
    return _edit_manifest(folder, lambda said: said["pairs"]["mask"].update(strategy=name))


def put_into_splits(folder: Path, name: str) -> Lines:
    (split,) = (folder / "dataset").glob("splits/*")
    _forge(folder / "dataset", f"splits/{split.name}", "split", name)
    return _read_dataset()


def put_into_scenes(folder: Path, name: str) -> Lines:
    for table in ("scenes", "rooms", "objects", "edges"):
        _forge(folder / "dataset", f"{table}/part-00000.parquet", "scene_id", name)
    return [*_read_dataset(), _words("bsg-data export dataset --to habitat --out exported")]


def put_into_report(folder: Path, name: str) -> Lines:
    _write_table(folder, "flat")
    first = "bsg-data build --source table objects.csv --out made --workers 1"
    _run_before(folder, f"{first} --parts 1/2")
    for report in folder.glob(".*made*/**/part-*.json"):
        said = json.loads(report.read_text("utf-8"))
        said["files"][0]["path"] = name
        report.write_text(json.dumps(said), "utf-8")
    return [_words(first)]


def put_into_statistics(folder: Path, name: str) -> Lines:
    rows = [[name, "0", "1", "1", "chair_1"], ["00006-aaaaaaaaaaa", "0", "1", "1", "bed_1"]]
    with zipfile.ZipFile(folder / "s.zip", "w") as archive:
        text = "".join(f"{','.join(row)}\n" for row in rows)
        archive.writestr(MEMBER, f"{STATISTICS}\n{text}")
    return _build_with_layouts(folder, "--hm3d-stats s.zip")


def put_into_members_of_a_zip(folder: Path, name: str) -> Lines:
    with zipfile.ZipFile(folder / "s.zip", "w") as archive:
        archive.writestr(name or "none", f"{STATISTICS}\nflat,0,1,1,bed_1\n")
        archive.writestr(MEMBER, f"{STATISTICS}\nflat,0,1,1,bed_1\n")
    return _build_with_layouts(folder, "--hm3d-stats s.zip")


def put_into_table(folder: Path, name: str) -> Lines:
    _write_table(folder, name)
    return _build_with_layouts(folder, "--source table objects.csv")


def put_into_list_of_behavior(folder: Path, name: str) -> Lines:
    said = {"scenes": {name: {"kitchen_0": {"fridge-abcdef": 1}}}}
    (folder / "list.json").write_text(json.dumps(said), "utf-8")
    return _build_with_layouts(folder, "--source behavior list.json")


def put_into_mesh(folder: Path, name: str) -> Lines:
    building = folder / "hm3d" / "train" / "00006-aaaaaaaaaaa"
    building.mkdir(parents=True)
    text = 'HM3D Semantic Annotations\n1,AABBCC,"chair",0\n'
    (building / "aaaaaaaaaaa.semantic.txt").write_text(text, "utf-8")
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36, "uri": name}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "images": [{"uri": name}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    both = []
    for number, inside in enumerate((False, True)):
        if inside:
            del tree["buffers"][0]["uri"]  # now the image alone is elsewhere
        (building / "aaaaaaaaaaa.semantic.glb").write_bytes(_glb(tree))
        shutil.copytree(folder / "hm3d", folder / f"hm3d-{number}")
        both.append(_words(f"bsg-data build --hm3d hm3d-{number} --out made-{number} --workers 1"))
    return both


def put_into_layout(folder: Path, name: str) -> Lines:
    _write_table(folder, "flat")
    lines = _build_with_layouts(folder, "--source table objects.csv")
    text = f"scene: {json.dumps(name)}\nrooms: !!python/name:os.system {{}}\n"
    (folder / "layouts" / "flat.yaml").write_text(text, "utf-8")
    return lines


def put_into_robot_graph(folder: Path, name: str) -> Lines:
    room = {"id": name, "label": name}
    seen = [{"id": name, "category": name, "room": name}]
    graph = {"scene_id": name or "home", "rooms": [room], "objects": seen}
    (folder / "graph.json").write_text(json.dumps(graph), "utf-8")
    return _believe("graph.json", run="universal")


def put_into_dsg(folder: Path, name: str) -> Lines:
    graph = robot_graph()
    for node in graph["nodes"]:
        node["attributes"]["name"] = name
    graph["metadata"] = {"labelspace": name, "labelspaces": {"_l2p0": [[3, name]]}}
    (folder / "dsg.json").write_text(json.dumps(graph), "utf-8")
    return [
        *_believe("dsg.json", run="universal", more="--labels mpcat40"),
        _words("bsg-belief dsg.json --labels mpcat40 --hydra annotated.json"),
    ]


def put_into_class_map_of_a_run(folder: Path, name: str) -> Lines:
    own = {"name": name, "spellings": "raw_category,category,class\nbed,bed,bed\n"}
    return _edit_header(folder, lambda said: said.update(class_maps=[own, name]))


def put_into_name_of_a_run(folder: Path, name: str) -> Lines:
    return _edit_header(folder, lambda said: said["config"].update(name=name))


def put_into_name_of_an_evaluated_run(folder: Path, name: str) -> Lines:
    put_into_name_of_a_run(folder, name)
    measure = "bsg-evaluate run --data dataset --resamples 0 --out out --write-predictions written"
    return [_words(measure)]


def put_into_members_of_a_run(folder: Path, name: str) -> Lines:
    def edit(said: dict[str, Any]) -> None:
        one = json.loads(json.dumps(said["config"]))
        said["config"]["model"] = {"family": "ensemble", "members": [name]}
        said["members"] = {name: one}

    return _edit_header(folder, edit)


def put_into_table_of_a_run(folder: Path, name: str) -> Lines:
    model = {"family": "prior-table", "table": name}
    return _edit_header(folder, lambda said: said["config"].update(model=model))


def put_into_family_of_a_run(folder: Path, name: str) -> Lines:
    return _edit_header(folder, lambda said: said["config"]["model"].update(family=name))


def put_into_configuration(folder: Path, name: str) -> Lines:
    ours = {
        "name": f"name = {json.dumps(name)}\n[model]\nfamily = 'gamma-poisson'\n",
        "family": f"[model]\nfamily = {json.dumps(name)}\n",
        "members": f"[model]\nfamily = 'ensemble'\nmembers = [{json.dumps(name)}]\n",
        "mask": f"[model]\nfamily = 'gamma-poisson'\n[data.mask]\nstrategy = {json.dumps(name)}\n",
    }
    lines = []
    for what, text in ours.items():
        (folder / f"{what}.toml").write_text(text, "utf-8")
        lines.append(_words(f"bsg-train --config {what}.toml --data dataset --out run-{what}"))
    return lines


def put_link_into_revision(folder: Path, name: str) -> Lines:
    return put_link_into_dataset(folder, name, ".staged")


def put_link_into_dataset(folder: Path, name: str, *extra: str) -> Lines:
    """Make folders of a dataset links to the victim: what would be written there is not."""
    target = Path(name) if name.startswith("/") else folder.parent.parent / "victim" / "evil"
    for inside in ("pairs", "class_maps", *extra):
        shutil.rmtree(folder / "dataset" / inside, ignore_errors=True)
        (folder / "dataset" / inside).symlink_to(target.parent, target_is_directory=True)
    return [
        _words("bsg-data pairs dataset --draws 1 --force"),
        _words("bsg-data split dataset --ratios 0.5 0.25 0.25 --force"),
    ]


def put_link_into_run(folder: Path, name: str) -> Lines:
    """Make the folder of an ensemble's members a link to the victim."""
    target = Path(name) if name.startswith("/") else folder.parent.parent / "victim" / "evil"
    shutil.rmtree(folder / "run" / "members", ignore_errors=True)
    (folder / "run" / "members").symlink_to(target.parent, target_is_directory=True)
    sets = '--set model.members=["doubled","input"] --set model.calibrate=false'
    return [_words(f"bsg-train --config ensemble --data dataset --out run {sets} --force")]


_EVALUATED = ("dataset", "run"), put_into_name_of_an_evaluated_run
PLACES = (
    Place("files of a manifest", ("dataset",), put_into_files),
    Place("class map of a manifest", ("dataset",), put_into_class_map),
    Place("hash of a class map of a manifest", ("dataset",), put_into_hash_of_class_map),
    Place("mask of a manifest", ("dataset",), put_into_mask),
    Place("splits.parquet", ("dataset",), put_into_splits),
    Place("scene ids of a dataset", ("dataset",), put_into_scenes),
    Place("report of an unfinished build", (), put_into_report),
    Place("scenes of HM3D's statistics, with layouts", (), put_into_statistics),
    Place("members of a zip", (), put_into_members_of_a_zip),
    Place("scenes of a table, with layouts", (), put_into_table),
    Place("scenes of BEHAVIOR, with layouts", (), put_into_list_of_behavior),
    Place("addresses in a mesh", (), put_into_mesh),
    Place("names in a layout", (), put_into_layout),
    Place("names in a robot's graph", (), put_into_robot_graph),
    Place("names in a graph of Hydra", (), put_into_dsg),
    Place("class maps of a checkpoint", ("run",), put_into_class_map_of_a_run),
    Place("name of a checkpoint", ("run",), put_into_name_of_a_run),
    Place("name of a run that is evaluated", *_EVALUATED, is_slow=True),
    Place("members of a checkpoint", ("run",), put_into_members_of_a_run),
    Place("prior table of a checkpoint", ("run",), put_into_table_of_a_run),
    Place("family of a checkpoint", ("run",), put_into_family_of_a_run),
    Place("configuration in TOML", ("dataset",), put_into_configuration),
    Place("links in a dataset", ("dataset",), put_link_into_dataset),
    Place("links in a dataset that is revised", ("dataset",), put_link_into_revision),
    Place("links in a run", ("dataset", "run"), put_link_into_run),
)


def _words(line: str) -> list[str]:
    return line.split()


def _read_dataset() -> Lines:
    return [
        _words("bsg-data check dataset"),
        _words("bsg-data info dataset"),
        _words("bsg-data pairs dataset --draws 1 --force --workers 1"),
        _words("bsg-train --config doubled --data dataset --out trained"),
        _words("bsg-data split dataset --ratios 0.5 0.25 0.25 --force"),
    ]


def _read_and_merge(folder: Path, edit: Callable[[dict[str, Any]], None]) -> Lines:
    _write_table(folder, "flat")
    _run_before(folder, "bsg-data build --source table objects.csv --out other --workers 1")
    return [*_edit_manifest(folder, edit), _words("bsg-data merge dataset other --out both")]


def _edit_manifest(folder: Path, edit: Callable[[dict[str, Any]], None]) -> Lines:
    path = folder / "dataset" / MANIFEST
    said = json.loads(path.read_text("utf-8"))
    edit(said)
    path.write_text(json.dumps(said), "utf-8")
    return _read_dataset()


def _forge(dataset: Path, name: str, column: str, value: str) -> None:
    """Give a table another value in its first row, and the manifest the hash that goes with it."""
    path = dataset / name
    table = pq.read_table(path)
    place = table.column_names.index(column)
    old = table[column][0].as_py()
    values = [value if found == old else found for found in table[column].to_pylist()]
    made = table.set_column(place, table.schema.field(place), pa.array(values, pa.string()))
    pq.write_table(made.cast(table.schema), path)
    manifest = read_manifest(dataset)
    files = tuple(
        describe_file(dataset, name, rows=entry.rows) if entry.path == name else entry
        for entry in manifest.files
    )
    commit_manifest(dataset, manifest.model_copy(update={"files": files}))


def _write_table(folder: Path, scene: str) -> None:
    with (folder / "objects.csv").open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerows([["scene", "room", "category"], [scene, "hall", "chair"]])
        rows.writerow(["house", scene or "r", "bed"])


def _build_with_layouts(folder: Path, source: str) -> Lines:
    (folder / "layouts").mkdir()
    (folder / "layouts" / "00006-aaaaaaaaaaa.yaml").write_text(LAYOUT, "utf-8")
    line = f"bsg-data build {source} --room-layouts layouts --out made --workers 1"
    return [_words(line), _words("bsg-data check made")]


def _believe(graph: str, *, run: str, more: str = "") -> Lines:
    written = "--out b.json --html b.html --tables tables"
    return [_words(f"bsg-belief {graph} --model {run} {written} {more}")]


def _edit_header(folder: Path, edit: Callable[[dict[str, Any]], None]) -> Lines:
    """Change what a checkpoint says of itself; its hashes are those of what it says then."""
    path = folder / "run" / BEST
    checkpoint = load_checkpoint(path)
    said = checkpoint.header.model_dump(mode="json")
    edit(said)
    save_checkpoint(path, _Said(said), checkpoint.tensors)  # type: ignore[arg-type]
    graph = {"scene_id": "home", "rooms": [{"id": "r"}]}
    (folder / "graph.json").write_text(json.dumps(graph), "utf-8")
    return [*_believe("graph.json", run="run"), _words("bsg-train --show run")]


@dataclass(frozen=True, slots=True)
class _Said:
    """A header that nobody has checked."""

    said: dict[str, Any]

    def model_copy(self, *, update: dict[str, Any]) -> _Said:
        return _Said({**self.said, **update})

    def model_dump_json(self) -> str:
        return json.dumps(self.said)


def _glb(tree: dict[str, Any]) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    binary = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    size = 12 + 8 + len(text) + 8 + len(binary)
    head = struct.pack("<4sIII4s", b"glTF", 2, size, len(text), b"JSON")
    return head + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary


def _run_before(folder: Path, line: str) -> None:
    command, *words = line.split()
    with working_in(folder):
        result = CliRunner().invoke(COMMANDS[command], words)
    assert result.exit_code == 0, result.output
