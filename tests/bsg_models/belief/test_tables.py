"""Belief graphs as parquet tables: without loss, in any order of rows, and damage is named."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from conftest import REPOSITORY
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_beliefs import (
    be_sure,
    forget_surroundings,
    header_of_version_1,
    header_of_version_2,
    header_of_version_3,
    make_belief,
)

from bsg_data.seals import SEAL, write_seal
from bsg_models.belief import table_rows, tables
from bsg_models.belief.network import to_networkx
from bsg_models.belief.tables import SCHEMAS, read_tables, write_tables
from bsg_models.errors import BeliefFileError


def put(table: pa.Table, path: Path) -> None:
    """Replace a table by another one, and seal it with the others."""
    pq.write_table(table, path)
    write_seal(path.parent, [f"{name}.parquet" for name in SCHEMAS])


@settings(
    max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_tables_are_read_back_by_scene(tmp_path: Path, seed: int, mode: str) -> None:
    first, second = make_belief(seed, mode=mode), make_belief(seed + 1, mode=mode, scene_id="t")
    write_tables([second, first], tmp_path)
    assert list(read_tables(tmp_path)) == [first, second]


def test_version_1_is_read(tmp_path: Path) -> None:
    """It had no corrected names, and named a class map."""
    write_tables([make_belief(1)], tmp_path)
    path = tmp_path / "nodes.parquet"
    table = pq.read_table(path)
    said = json.loads(table.schema.metadata[b"bsg.beliefs"])
    old = {scene: header_of_version_1(header) for scene, header in said.items()}
    table = table.drop_columns(["corrected"])
    put(table.replace_schema_metadata({"bsg.beliefs": json.dumps(old)}), path)
    assert list(read_tables(tmp_path)) == [make_belief(1)]


def test_version_2_is_read(tmp_path: Path) -> None:
    """It had no surroundings."""
    write_tables([make_belief(1)], tmp_path)
    path = tmp_path / "nodes.parquet"
    table = pq.read_table(path)
    said = json.loads(table.schema.metadata[b"bsg.beliefs"])
    old = {scene: header_of_version_2(header) for scene, header in said.items()}
    table = table.drop_columns(["floor_area", "room_type", "hidden_share_sd"])
    put(table.replace_schema_metadata({"bsg.beliefs": json.dumps(old)}), path)
    assert list(read_tables(tmp_path)) == [forget_surroundings(make_belief(1))]


def test_version_3_is_read(tmp_path: Path) -> None:
    """It was sure of every hidden share."""
    write_tables([make_belief(1)], tmp_path)
    path = tmp_path / "nodes.parquet"
    table = pq.read_table(path)
    said = json.loads(table.schema.metadata[b"bsg.beliefs"])
    old = {scene: header_of_version_3(header) for scene, header in said.items()}
    table = table.drop_columns(["hidden_share_sd"])
    put(table.replace_schema_metadata({"bsg.beliefs": json.dumps(old)}), path)
    assert list(read_tables(tmp_path)) == [be_sure(make_belief(1))]


def test_rows_may_be_in_any_order(tmp_path: Path) -> None:
    beliefs = [make_belief(seed, scene_id=f"s{seed}") for seed in range(3)]
    write_tables(beliefs, tmp_path)
    rng = np.random.default_rng(0)
    for name in SCHEMAS:
        table = pq.read_table(tmp_path / f"{name}.parquet")
        put(table.take(rng.permutation(len(table))), tmp_path / f"{name}.parquet")
    assert list(read_tables(tmp_path)) == beliefs


def test_no_tables_are_read_back(tmp_path: Path) -> None:
    write_tables([], tmp_path)
    assert list(read_tables(tmp_path)) == []


def test_rows_agree_with_the_graph_of_networkx(tmp_path: Path) -> None:
    belief = make_belief(5)
    write_tables([belief], tmp_path)
    graph = to_networkx(belief)
    nodes = pd.read_parquet(tmp_path / "nodes.parquet")
    for row in nodes.itertuples():
        assert graph.nodes[row.node]["kind"] == row.kind
        assert graph.nodes[row.node].get("id") == (None if pd.isna(row.id) else row.id)
    assert (nodes["kind"] == "blind").sum() == len(belief.blind) > 0
    edges = pd.read_parquet(tmp_path / "edges.parquet")
    assert [(r.source, r.target, r.kind) for r in edges.itertuples()] == sorted(
        graph.edges(data="kind")
    )
    histograms = pd.read_parquet(tmp_path / "histograms.parquet")
    np.testing.assert_array_equal(np.stack(histograms["input"].tolist()), belief.inputs)
    np.testing.assert_array_equal(np.stack(histograms["expected"].tolist()), belief.expected)


def test_each_row_is_unpacked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading is linear in the number of buildings: no row is looked at for another building."""
    write_tables([make_belief(seed, scene_id=f"s{seed}") for seed in range(7)], tmp_path)
    unpacked = dict.fromkeys(SCHEMAS, 0)
    unpack = tables._unpack

    def count(header: object, *parts: pa.Table) -> object:
        for name, part in zip(SCHEMAS, parts, strict=True):
            unpacked[name] += len(part)
        return unpack(header, *parts)

    monkeypatch.setattr(tables, "_unpack", count)
    assert len(list(read_tables(tmp_path))) == 7
    rows = {name: pq.read_metadata(tmp_path / f"{name}.parquet").num_rows for name in SCHEMAS}
    assert unpacked == rows


@pytest.mark.parametrize("rows", [1, 40, 65_536])
def test_row_groups_are_written_and_read_as_they_come(
    tmp_path: Path, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tables in the order of the scenes are read a row group at a time; others are read whole."""
    monkeypatch.setattr(table_rows, "ROWS_PER_GROUP", rows)
    beliefs = [make_belief(seed, scene_id=f"s{seed}") for seed in range(7)]
    write_tables(iter(beliefs), tmp_path)
    groups = pq.read_metadata(tmp_path / "nodes.parquet").num_row_groups
    assert groups == 7 if rows == 1 else 1 <= groups < 7
    assert list(read_tables(tmp_path)) == beliefs
    write_tables(reversed(beliefs), tmp_path)
    assert list(read_tables(tmp_path)) == beliefs


def _set(table: pa.Table, name: str, row: int, value: object) -> pa.Table:
    values = table[name].to_pylist()
    values[row] = value
    column = pa.array(values, table.schema.field(name).type)
    return table.set_column(table.schema.get_field_index(name), name, column)


def _edit_header(table: pa.Table, **changes: object) -> pa.Table:
    headers = json.loads(table.schema.metadata[b"bsg.beliefs"])
    headers["s"] |= changes
    return table.replace_schema_metadata({"bsg.beliefs": json.dumps(headers)})


@pytest.mark.parametrize(
    ("name", "change", "expected"),
    [
        ("nodes", lambda t: t.drop_columns(["kind"]), "kind"),
        ("nodes", lambda t: t.slice(1), "expected the building, then rooms"),
        ("nodes", lambda t: pa.concat_tables([t, t]), "one row per node"),
        ("nodes", lambda t: t.replace_schema_metadata({}), "bsg.beliefs"),
        ("nodes", lambda t: _set(t, "floor_area", 1, -1.0), "no room has -1.0 square"),
        ("nodes", lambda t: _set(t, "room_type", 1, [("axe", 1.0)]), "'axe'"),
        ("nodes", lambda t: _set(t, "room_type", 1, [("bar", 1.5)]), "a probability"),
        ("nodes", lambda t: t.replace_schema_metadata({"bsg.beliefs": "[1]"}), "no tables"),
        ("nodes", lambda t: _edit_header(t, version=9), "found bsg-belief-graph 9"),
        ("nodes", lambda t: _edit_header(t, mode="x"), "mode"),
        ("nodes", lambda t: _set(t, "scene_id", 0, "u"), "metadata does not list"),
        ("nodes", lambda t: _set(t, "id", 1, None), "id: 1 nulls"),
        ("nodes", lambda t: _set(t, "hidden_share", 1, 1.5), "expected 0 to 1, found 1.5"),
        ("nodes", lambda t: _set(t, "hidden_share", 1, float("nan")), "expected 0 to 1, found nan"),
        ("nodes", lambda t: _set(t, "hidden_share_sd", 1, 0.5), "room 'r0': standard deviation"),
        ("nodes", lambda t: _set(t, "hidden_share_sd", 1, float("nan")), "found nan"),
        ("nodes", lambda t: _set(t, "position", 1, [1.0, 2.0]), "damaged"),
        ("nodes", lambda t: _set(t, "position", 1, [1.0, 2.0, float("inf")]), "metres away"),
        ("nodes", lambda t: _set(t, "footprint", 1, [1.0] * 4), "3 corners"),
        ("nodes", lambda t: _set(t, "presence", len(t) - 1, 2.0), "another presence than its room"),
        ("nodes", lambda t: _set(t, "class", len(t) - 1, "ufo"), "damaged.*ufo"),
        ("edges", lambda t: t.filter(pc.field("kind") != "expects"), "damaged"),
        ("edges", lambda t: _set(t, "source", len(t) - 1, 99), "room 99"),
        ("histograms", lambda t: t.slice(1), "one row per node"),
        ("histograms", lambda t: _set(t, "expected", 0, [1.0]), "45 classes"),
        ("histograms", lambda t: _set(t, "expected", 0, [-1.0] * 45), "not negative"),
        ("histograms", lambda t: _set(t, "presence", 0, [None] * 45), "between 0 and 1"),
    ],
)
def test_tables_that_were_edited_are_refused(
    tmp_path: Path, name: str, change: Callable[[pa.Table], pa.Table], expected: str
) -> None:
    write_tables([make_belief(4)], tmp_path)
    path = tmp_path / f"{name}.parquet"
    put(change(pq.read_table(path)), path)
    with pytest.raises(BeliefFileError, match=expected):
        list(read_tables(tmp_path))


def test_a_folder_without_tables_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BeliefFileError, match="no tables"):
        list(read_tables(tmp_path))


def test_two_graphs_of_one_building_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BeliefFileError, match="two belief graphs of s"):
        write_tables([make_belief(1), make_belief(2)], tmp_path / "tables")
    assert not (tmp_path / "tables").exists()


def test_json_and_tables_do_without_networkx() -> None:
    code = (
        "import sys, types\n"
        "root = sys.modules['bsg_models'] = types.ModuleType('bsg_models')\n"
        f"root.__path__ = [{str(REPOSITORY / 'bsg_models')!r}]\n"  # without what the root exports
        "sys.modules['networkx'] = None\n"
        "import bsg_models.belief.document, bsg_models.belief.hydra, bsg_models.belief.tables\n"
        "assert 'torch' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_tables_that_were_changed_or_mixed_are_refused(tmp_path: Path) -> None:
    write_tables([make_belief(1)], tmp_path / "one")
    write_tables([make_belief(2)], tmp_path / "two")
    (tmp_path / "two" / "edges.parquet").replace(tmp_path / "one" / "edges.parquet")
    with pytest.raises(BeliefFileError, match=r"edges\.parquet: was changed"):
        list(read_tables(tmp_path / "one"))
    (tmp_path / "one" / SEAL).unlink()
    with pytest.raises(BeliefFileError, match=f"{SEAL}, which nodes.parquet was written with"):
        list(read_tables(tmp_path / "one"))
    write_seal(tmp_path / "one", ["nodes.parquet"])
    with pytest.raises(BeliefFileError, match="does not list edges"):
        list(read_tables(tmp_path / "one"))
