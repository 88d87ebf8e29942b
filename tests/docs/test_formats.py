"""The package of formats: installed, it keeps the contract, and commands write by its suffixes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result
from conftest import REPOSITORY
from contracts import FormatContract
from example_packages import EXAMPLES, installed, read_project
from random_beliefs import make_belief
from refusals import refuses

from bsg_cli.belief import main
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.seal import require_seal, write_seal
from bsg_robot.answers import belief_report
from bsg_robot.answers.belief_report import BeliefRequest, report_beliefs
from bsg_robot.graph.document import encode_belief, to_networkx
from bsg_robot.graph.formats import FORMATS, choose_format, read_belief, write_beliefs
from bsg_robot.graph.graph_file import open_graph_file

FOLDER = EXAMPLES / "formats"
OFFICE = REPOSITORY / "docs" / "office.json"
PROJECT = read_project((FOLDER / "pyproject.toml").read_text("utf-8"))
SEED = next(seed for seed in range(99) if make_belief(seed).partial.objects)
CLOSE = 0.0051  # metres: outlines are in whole centimetres, as on a plan


@pytest.fixture(scope="module", autouse=True)
def _installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with installed(PROJECT, FOLDER, tmp_path_factory.mktemp("site")):
        yield


class TestFormats(FormatContract):
    @pytest.fixture(autouse=True, params=PROJECT["entry-points"]["bsg_robot.formats"])
    def _row(self, request: pytest.FixtureRequest) -> None:
        if request.param == "rerun":
            pytest.importorskip("rerun", reason="rerun-sdk is not installed")
        self.name = request.param


def call(*words: object, code: int = 0) -> Result:
    done = CliRunner().invoke(main, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done


def write(name: str, beliefs: Any, path: Path) -> None:
    write_beliefs(beliefs, path, FORMATS[name])


def test_tables_hold_what_the_graphs_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bsg_formats import tables

    monkeypatch.setattr(tables, "_ROWS_PER_GROUP", 40)
    beliefs = [make_belief(SEED + number, scene_id=f"s{number}") for number in range(7)]
    write("tables", iter(beliefs), tmp_path / "b.tables")
    nodes, edges, histograms = (
        pd.read_parquet(tmp_path / "b.tables" / f"{name}.parquet")
        for name in ("nodes", "edges", "histograms")
    )
    header = pq.read_metadata(tmp_path / "b.tables" / "nodes.parquet")
    assert header.num_row_groups > 1
    for belief in beliefs:
        graph, scene = to_networkx(belief), belief.partial.scene_id
        mine = nodes[nodes.scene_id == scene]
        links = edges[edges.scene_id == scene]
        assert [kind for _, kind in graph.nodes(data="kind")] == list(mine.kind)
        found = sorted(graph.edges(data="kind"))
        assert found == list(zip(links.source, links.target, links.kind, strict=True))
        assert nx.is_weakly_connected(graph)
        rooms, blind = mine[mine.kind == "room"], mine[mine.kind == "blind"]
        assert list(rooms.id) == [room.name for room in belief.partial.rooms]
        assert list(rooms.hidden_share) == [room.hidden_share for room in belief.partial.rooms]
        assert list(blind.presence) == [node.presence for node in belief.blind]
        objects = mine[mine.kind == "object"]
        seen = belief.partial.objects
        for name in ("score", "time", "stays"):
            assert [*objects[name].replace({np.nan: None})] == [getattr(one, name) for one in seen]
        more, partial = json.loads(mine.more.fillna("{}").iloc[0]), encode_belief(belief)["partial"]
        for name in ("now", "memory", "customs", "looks"):
            assert more.get(name) == partial.get(name)
        tables_of = histograms[histograms.scene_id == scene]
        for name in ("expected", "presence"):
            found = np.stack(list(tables_of[name]))
            np.testing.assert_array_equal(found, getattr(belief, name))
        np.testing.assert_array_equal(np.stack(list(tables_of.input)), belief.inputs)
    said = json.loads(header.metadata[b"bsg.beliefs"])
    assert (said["model"], said["mode"]) == ("random", "complete")
    with refuses(RecipeError, "format-written-only", tmp_path / "b.tables"):
        read_belief(tmp_path / "b.tables")


def test_any_number_of_beliefs_goes_to_tables_and_some_to_a_page(
    dataset: Path, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables, some, page = tmp_path / "all.tables", tmp_path / "b.tables", tmp_path / "p.html"
    request = BeliefRequest(run=run, dataset=dataset, split="train", out=(tables,))
    whole = report_beliefs(request)
    assert len(require_seal(tables) or ()) == 3
    monkeypatch.setattr(belief_report, "MOST_HELD", 2)
    few = report_beliefs(replace(request, out=(some, page)))
    assert few.graphs == whole.graphs[:2]
    assert (few.number, few.blind, few.rooms) == (whole.number, whole.blind, whole.rooms)
    for name in ("nodes", "edges", "histograms"):
        assert (some / f"{name}.parquet").read_bytes() == (tables / f"{name}.parquet").read_bytes()
    shown = page.read_text("utf-8")
    assert few.graphs[1].partial.scene_id in shown
    assert whole.graphs[2].partial.scene_id not in shown


def test_tables_take_the_place_of_no_run_and_of_no_file_of_somebody_else(
    run: Path, tmp_path: Path
) -> None:
    """With --force they replaced the seal of a run, which was then not checked any more."""
    other, mine = tmp_path / "evaluated.tables", tmp_path / "mine.tables"
    run = run.rename(tmp_path / "run.tables")
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    graph = open_graph_file(OFFICE)
    for folder, name in ((other, "evaluation.json"), (mine, "edges.parquet")):
        folder.mkdir()
        (folder / name).write_text("mine")
    write_seal(other, ["evaluation.json"])
    for folder in (run, other, mine):
        with pytest.raises(DatasetError):
            report_beliefs(BeliefRequest(run=run, graphs=(graph,), out=(folder,), force=True))
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    assert (mine / "edges.parquet").read_text() == "mine"
    (mine / "edges.parquet").unlink()
    for _ in range(2):  # over its own tables it writes
        report_beliefs(BeliefRequest(run=run, graphs=(graph,), out=(mine,), force=True))
    with refuses(DatasetError, "path-taken", mine):
        report_beliefs(BeliefRequest(run=run, graphs=(graph,), out=(mine,)))


def read_recording(path: Path) -> dict[str, list[Any]]:
    """Return `ENTITY COLUMN` → what it holds at each step; static columns have one row."""
    found = {}
    for chunk in open_recording(path).stream():
        for name, rows in chunk.to_record_batch().to_pydict().items():
            if name == "step":
                assert rows == list(range(len(rows))), "a row for every step"
            elif not name.startswith("rerun.controls"):
                entity = str(chunk.entity_path).lstrip("/").replace("\\", "")
                found[f"{entity} {name.rpartition(':')[2]}"] = rows
    return found


def open_recording(path: Path) -> Any:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    try:
        from rerun.chunk import RrdReader
    except ImportError:  # rerun-sdk up to 0.38
        from rerun.experimental import RrdReader
    return RrdReader(path)


def test_a_belief_is_recorded(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    belief, path = make_belief(SEED), tmp_path / "new" / "belief.rrd"
    write("rerun", [belief], path)
    found, partial = read_recording(path), belief.partial
    for node, room in enumerate(partial.rooms, 1):
        entity = f"world/rooms/{room.name}"
        assert found[f"expected/{room.name} scalars"] == [[belief.hidden[node].sum()]]
        assert found[f"{entity} labels"][0][0].startswith(room.label or room.name)
        if room.box is not None:
            (centre,), (half,) = found[f"{entity} centers"][0], found[f"{entity} half_sizes"][0]
            assert np.subtract(centre, half) == pytest.approx(room.box.minimum, abs=CLOSE)
            assert np.add(centre, half) == pytest.approx(room.box.maximum, abs=CLOSE)
    for c, name in enumerate([*partial.class_space.classes, "no class"]):
        seen = [
            one
            for one in partial.objects
            if c == (45 if one.class_index is None else one.class_index)
        ]
        entity = f"world/objects/{name}"
        assert found.get(f"{entity} labels", [[]]) == [[one.raw_category for one in seen]]
        for one, spot in zip(seen, found.get(f"{entity} positions", [[]])[0], strict=True):
            assert one.position is None or spot == pytest.approx(one.position, abs=CLOSE)
        blind = [one for one in belief.blind if one.class_index == c]
        entity = f"world/blind/{name}"
        assert found.get(f"{entity} presence", [[]]) == [[one.presence for one in blind]]
        rooms = [partial.rooms[one.room_index - 1].name for one in blind]
        assert found.get(f"{entity} room", [[]]) == [rooms]
    assert len(found["world/adjacency strips"][0]) == len(partial.adjacency)


def test_several_graphs_are_steps_of_one_recording(run: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    out, said = tmp_path / "day.rrd", json.loads(OFFICE.read_text("utf-8"))
    said["rooms"].append({"id": "attic", "visited": False})
    later = tmp_path / "later.json"
    later.write_text(json.dumps(said))
    done = call(OFFICE, later, "--model", run, "--out", out)
    assert f"written: {out}" in done.stdout
    found = read_recording(out)
    assert [len(row) for row in found["expected/attic scalars"]] == [0, 1]
    assert [len(row) for row in found["world/rooms/attic centers"]] == [0, 1]
    assert "--force" in call(OFFICE, "--model", run, "--out", out, code=1).stderr
    call(OFFICE, "--model", run, "--out", out, "--force")
    write("rerun", [], tmp_path / "empty.rrd")


def test_a_missing_library_is_told_before_anything_is_asked(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bsg_formats import recording

    assert choose_format(Path("b.rrd")).name == "rerun"
    monkeypatch.setattr(recording, "find_spec", lambda name: None)
    with refuses(RecipeError, "library-missing"):  # it has a path
        write("rerun", iter(lambda: pytest.fail("a graph was asked for"), None), tmp_path / "b.rrd")
    done = call(OFFICE, "--model", run, "--out", tmp_path / "b.rrd", code=2)
    assert "pip install 'docs/examples/formats[rerun]'" in done.stderr
    assert not (tmp_path / "b.rrd").exists()
