"""No name in a file leads out of the folders that a command was given.

Names of an attacker stand wherever a name could become a path. A folder beside is watched: nothing
in it is opened, made, moved or removed. A command that refuses a name says so, without a traceback.
"""

from __future__ import annotations

import csv
import json
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from conftest import working_in
from watched_folder import snapshot, watch

from bsg_cli.registry import COMMANDS
from bsg_data.dataset.manifest import MANIFEST
from bsg_models.runs.checkpoint import load_checkpoint, save_checkpoint
from bsg_models.runs.run_folder import BEST

Put = Callable[[Path, str], list[str]]  # puts a name into a folder; returns the commands to try
READ_DATASET = [
    "bsg-data check dataset",
    "bsg-data info dataset",
    "bsg-data pairs dataset --draws 1 --force --workers 1",
    "bsg-data split dataset --ratios 0.5 0.25 0.25 --force",
]
BELIEVE = "bsg-belief {} --model {} --out b.json --out b.html"


def hostile_names(victim: Path) -> tuple[str, ...]:
    """Return names that lead, or could lead, to a file `evil` of the victim, and odd ones."""
    up = [f"{'../' * depth}{victim.name}/evil" for depth in (1, 2, 3, 4)]
    ours = [f"train/../../../{victim.name}/evil", str(victim / "evil"), f"file://{victim}/evil"]
    odd = [f"..\\..\\{victim.name}\\evil", "", "..", "nul\0l", "x" * 5_000, "-rf", "two\nlines"]
    return (*up, *ours, *odd)


def put_into_files(folder: Path, name: str) -> list[str]:
    return _edit_manifest(folder, lambda said: said["files"][0].update(path=name))


def put_into_class_map(folder: Path, name: str) -> list[str]:
    entry = {"version": name, "sha256": "0" * 64}
    return _edit_manifest(folder, lambda said: said["sources"][0].update(class_map=entry))


def put_into_table(folder: Path, name: str) -> list[str]:
    _write_table(folder, name)
    return _build_with_layouts(folder, "--source table objects.csv")


def put_into_layout(folder: Path, name: str) -> list[str]:
    _write_table(folder, "flat")
    lines = _build_with_layouts(folder, "--source table objects.csv")
    text = f"scene: {json.dumps(name)}\nrooms: !!python/name:os.system {{}}\n"
    (folder / "layouts" / "flat.yaml").write_text(text, "utf-8")
    return lines


def put_into_class_map_of_a_run(folder: Path, name: str) -> list[str]:
    own = {"name": name, "spellings": "raw_category,category,class\nbed,bed,bed\n"}
    return _edit_header(folder, lambda said: said.update(class_maps=[own, name]))


def put_into_members_of_a_run(folder: Path, name: str) -> list[str]:
    def edit(said: dict[str, Any]) -> None:
        said["members"] = {name: json.loads(json.dumps(said["config"]))}
        said["config"]["model"] = {"family": "ensemble", "members": [name]}

    return _edit_header(folder, edit)


PLACES: tuple[Put, ...] = (
    put_into_files,
    put_into_class_map,
    put_into_table,
    put_into_layout,
    put_into_class_map_of_a_run,
    put_into_members_of_a_run,
)


@pytest.mark.heavy
@pytest.mark.parametrize("put", PLACES, ids=lambda put: put.__name__)
def test_a_name_leads_nowhere(
    put: Put, request: pytest.FixtureRequest, tmp_path: Path, full: bool
) -> None:
    victim = write_victim(tmp_path / "victim")
    names = hostile_names(victim)
    first = PLACES.index(put) % len(names)
    misses: list[str] = []
    for number, name in enumerate(names if full else names[first : first + 1]):
        folder = tmp_path / "work" / str(number)
        folder.mkdir(parents=True)
        for what in ("dataset", "run"):
            shutil.copytree(request.getfixturevalue(f"_{what}"), folder / what)
        lines = put(folder, name)
        before = snapshot(tmp_path / "work")
        with watch(victim) as events:
            faults = [fault for line in lines if (fault := try_line(line.split(), folder))]
        made = snapshot(tmp_path / "work").keys() - before.keys()
        outside = {path for path in made if not path.startswith(f"{number}/")}
        misses += [f"{name[:60]!r}: {what}" for what in (*faults, *events, *sorted(outside))]
        shutil.rmtree(folder)
    assert not misses, "\n".join(misses)


def try_line(words: Sequence[str], folder: Path) -> str:
    """Run a command in a folder; return what is wrong with how it ended, empty if nothing is."""
    with working_in(folder):
        done = CliRunner().invoke(COMMANDS[words[0]], list(words[1:]))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return f"{' '.join(words)}: {done.exception!r}"
    silent = done.exit_code != 0 and not done.output
    return f"{' '.join(words)}: exit {done.exit_code} without a word" * silent


def test_the_watch_sees_who_opens_makes_and_removes(tmp_path: Path) -> None:
    victim = write_victim(tmp_path / "victim")
    with watch(victim) as events:
        (victim / "evil.csv").read_bytes()
        (victim / "new").touch()
        (victim / "evil.json").unlink()
    assert {"new is not what it was", "evil.json is not what it was"} <= set(events)
    assert ("evil.csv was opened" in events) == (sys.platform == "linux")
    with watch(victim) as events:
        (victim / "evil.png").exists()
    assert events == []


def write_victim(folder: Path) -> Path:
    """Make what must not be touched: a file for every suffix that a reader might look for."""
    folder.mkdir()
    beside = ("", ".csv", ".classes.csv", ".yaml", ".json", ".safetensors", ".png", ".parquet")
    for suffix in (*beside, "-00000.parquet"):
        (folder / f"evil{suffix}").write_text("room_label,kitchen\n", "utf-8")
    return folder


def _edit_manifest(folder: Path, edit: Callable[[dict[str, Any]], None]) -> list[str]:
    path = folder / "dataset" / MANIFEST
    said = json.loads(path.read_text("utf-8"))
    edit(said)
    path.write_text(json.dumps(said), "utf-8")
    shutil.copytree(folder / "dataset", folder / "other")
    return [*READ_DATASET, "bsg-data merge dataset other --out both"]


def _write_table(folder: Path, scene: str) -> None:
    with (folder / "objects.csv").open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerows([["scene", "room", "category"], [scene, "hall", "chair"]])
        rows.writerow(["house", scene or "r", "bed"])


def _build_with_layouts(folder: Path, source: str) -> list[str]:
    (folder / "layouts").mkdir()
    (folder / "layouts" / "00006-aaaaaaaaaaa.yaml").write_text("rooms: {}\n", "utf-8")
    line = f"bsg-data build {source} --room-layouts layouts --out made --workers 1"
    return [line, "bsg-data check made"]


def _edit_header(folder: Path, edit: Callable[[dict[str, Any]], None]) -> list[str]:
    """Change what a checkpoint says of itself; its hashes are those of what it says then."""
    path = folder / "run" / BEST
    checkpoint = load_checkpoint(path)
    said = checkpoint.header.model_dump(mode="json")
    edit(said)
    save_checkpoint(path, _Said(said), checkpoint.tensors)  # type: ignore[arg-type]
    graph = {"scene_id": "home", "rooms": [{"id": "r"}]}
    (folder / "graph.json").write_text(json.dumps(graph), "utf-8")
    measure = "bsg-evaluate dataset --model run --out out --write-predictions written"
    return [BELIEVE.format("graph.json", "run"), "bsg-models show run", measure]


class _Said:
    """A header that nobody has checked."""

    def __init__(self, said: dict[str, Any]) -> None:
        self.said = said

    def model_copy(self, *, update: dict[str, Any]) -> _Said:
        return _Said({**self.said, **update})

    def model_dump_json(self) -> str:
        return json.dumps(self.said)
