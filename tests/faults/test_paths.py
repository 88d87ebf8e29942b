"""No name in a file leads out of the folders that a command was given.

Names of an attacker stand wherever a name could become a path. A folder beside stays what it is,
and no word of it is shown. A command that refuses a name says so, without a traceback.
"""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from conftest import working_in
from killed_process import snapshot

from bsg_cli.registry import COMMANDS
from bsg_data.seal import write_seal
from bsg_models.runs.checkpoint import load_checkpoint, save_checkpoint
from bsg_models.runs.checkpoint_file import BEST

Put = Callable[[Path, str], list[str]]  # puts a name into a folder; returns the commands to try
SECRET = "secret word"


def hostile_names(victim: Path) -> tuple[str, ...]:
    """Return names that lead, or could lead, to a file `evil` of the victim, and odd ones."""
    up = [f"{'../' * depth}{victim.name}/evil" for depth in (1, 2, 3, 4)]
    ours = [f"train/../../../{victim.name}/evil", str(victim / "evil"), f"file://{victim}/evil"]
    odd = [f"..\\..\\{victim.name}\\evil", "", "..", "nul\0l", "x" * 5_000, "-rf", "two\nlines"]
    return (*up, *ours, *odd)


def put_into_table(folder: Path, name: str) -> list[str]:
    with (folder / "objects.csv").open("w", encoding="utf-8", newline="") as file:
        head, first = ["scene", "room", "category"], [name, "hall", "chair"]
        csv.writer(file).writerows([head, first, ["house", name or "r", "bed"]])
    return build_with_layouts(folder)


def put_into_layout(folder: Path, name: str) -> list[str]:
    lines = put_into_table(folder, "flat")
    text = f"scene: {json.dumps(name)}\nrooms: !!python/name:os.system {{}}\n"
    (folder / "layouts" / "flat.yaml").write_text(text, "utf-8")
    return lines


def build_with_layouts(folder: Path) -> list[str]:
    (folder / "layouts").mkdir()
    (folder / "layouts" / "house.yaml").write_text("rooms: {}\n", "utf-8")
    build = "bsg-data build --source table objects.csv --room-layouts layouts"
    return [f"{build} --out made --workers 1", "bsg-data check made"]


def put_into_class_map_of_a_run(folder: Path, name: str) -> list[str]:
    own = {"name": name, "spellings": "raw_category,category,class\nbed,bed,bed\n"}
    return edit_header(folder, lambda said: said.update(class_maps=[own, name]))


def put_into_members_of_a_run(folder: Path, name: str) -> list[str]:
    def edit(said: dict[str, Any]) -> None:
        said["members"] = {name: json.loads(json.dumps(said["config"]))}
        said["config"]["model"] = {"family": "ensemble", "members": [name]}

    return edit_header(folder, edit)


def edit_header(folder: Path, edit: Callable[[dict[str, Any]], None]) -> list[str]:
    """Change what a checkpoint says of itself; its hashes are those of what it says then."""
    checkpoint = load_checkpoint(folder / "run" / BEST)
    said = checkpoint.header.model_dump(mode="json")
    edit(said)
    save_checkpoint(folder / "run" / BEST, Said(said), checkpoint.tensors)  # type: ignore[arg-type]
    write_seal(folder / "run", [BEST])
    graph = {"scene_id": "home", "rooms": [{"id": "r"}]}
    (folder / "graph.json").write_text(json.dumps(graph), "utf-8")
    measure = "bsg-evaluate dataset --model run --out out --write-predictions written"
    believe = "bsg-belief graph.json --model run --out b.json --out b.html"
    return [believe, "bsg-models show run", measure]


class Said:
    """A header that nobody has checked."""

    def __init__(self, said: dict[str, Any]) -> None:
        self.said = said

    def model_dump_json(self) -> str:
        return json.dumps(self.said)


PLACES: tuple[Put, ...] = (
    put_into_table,
    put_into_layout,
    put_into_class_map_of_a_run,
    put_into_members_of_a_run,
)


@pytest.mark.heavy
@pytest.mark.parametrize("put", PLACES, ids=lambda put: put.__name__)
def test_a_name_leads_nowhere(
    put: Put, dataset: Path, run: Path, tmp_path_factory: pytest.TempPathFactory, full: bool
) -> None:
    root = tmp_path_factory.mktemp("paths")
    (root / "victim").mkdir()
    for suffix in ("", ".csv", ".classes.csv", ".yaml", ".json", ".safetensors", ".parquet"):
        (root / "victim" / f"evil{suffix}").write_text(f"room_label,{SECRET}\n", "utf-8")
    names = hostile_names(root / "victim")
    first = PLACES.index(put) % len(names)
    misses: list[str] = []
    for name in names if full else names[first : first + 1]:
        folder = root / "work" / "here"
        for what in (dataset, run):
            shutil.copytree(what, folder / what.name)
        lines, before = put(folder, name), snapshot(root)
        faults = [fault for line in lines if (fault := try_line(line.split(), folder))]
        after = snapshot(root)
        outside = {
            path
            for path in before.keys() | after.keys()
            if before.get(path) != after.get(path) and not path.startswith("work/here/")
        }
        misses += [f"{name[:60]!r}: {what}" for what in (*faults, *sorted(outside))]
        shutil.rmtree(folder)
    assert not misses, "\n".join(misses)


def try_line(words: Sequence[str], folder: Path) -> str:
    """Run a command in a folder; return what is wrong with how it ended, empty if nothing is."""
    with working_in(folder):
        done = CliRunner().invoke(COMMANDS[words[0]], list(words[1:]))
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return f"{' '.join(words)}: {done.exception!r}"
    if SECRET in done.output:
        return f"{' '.join(words)}: shows {SECRET}"
    silent = done.exit_code != 0 and not done.output
    return f"{' '.join(words)}: exit {done.exit_code} without a word" * silent
