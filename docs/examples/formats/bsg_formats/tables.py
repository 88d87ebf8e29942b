"""Write belief graphs of many buildings as parquet tables, for pandas and DuckDB.

`nodes` has one row per building, room, object and blind node; `edges` one per edge; `histograms`
one per building and room. Every table begins with `scene_id`. Nodes are numbered: 0 the building,
then rooms, objects and blind nodes. Times are seconds, dates since 1970 in UTC. `more` has what no
column has, as JSON: of the building what it remembers, and looks. Model, mode and class space are
JSON in the metadata of `nodes`. Tables are not read back: JSON is for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.files import AnyPath, encode_json
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.clock import read_time
from bsg_robot.errors import BeliefFileError
from bsg_robot.graph.document import encode_belief, list_edges, list_nodes
from bsg_robot.graph.formats import FormatRow

_ROWS_PER_GROUP = 65_536
_TEXT, _WHOLE, _NUMBER = pa.string(), pa.int32(), pa.float64()
_WHOLES, _NUMBERS = pa.list_(_WHOLE), pa.list_(_NUMBER)
_SCHEMAS = {
    "nodes": pa.schema(
        {
            "scene_id": _TEXT,
            "node": _WHOLE,
            **dict.fromkeys(("kind", "id", "room", "category", "corrected", "class", "on"), _TEXT),
            **dict.fromkeys(("score", "time", "stays", "expected", "presence"), _NUMBER),
            "visited": pa.bool_(),
            **dict.fromkeys(("hidden_share", "hidden_share_sd"), _NUMBER),
            "label": _TEXT,
            **dict.fromkeys(("position", "box", "footprint"), _NUMBERS),
            "floor_index": pa.int16(),
            "floor_area": _NUMBER,
            "room_type": pa.map_(_TEXT, _NUMBER),
            **dict.fromkeys(("building_kind", "source", "more"), _TEXT),
        }
    ),
    "edges": pa.schema({"scene_id": _TEXT, "source": _WHOLE, "target": _WHOLE, "kind": _TEXT}),
    "histograms": pa.schema(
        {
            "scene_id": _TEXT,
            "node": _WHOLE,
            "input": _WHOLES,
            **dict.fromkeys(("expected", "presence"), _NUMBERS),
        }
    ),
}


def write_tables(beliefs: Iterable[BeliefGraph], folder: AnyPath) -> None:
    """Write belief graphs as `nodes`, `edges` and `histograms`.parquet, a row group at a time.

    Raises:
        BeliefFileError: if two belief graphs have the same building.
    """
    folder, scenes = Path(folder), set()
    header: dict[str, Any] = {}
    waiting: dict[str, list[dict[str, Any]]] = {name: [] for name in _SCHEMAS}
    with ExitStack() as stack:
        writers = {
            name: stack.enter_context(
                pq.ParquetWriter(folder / f"{name}.parquet", schema, compression="zstd")
            )
            for name, schema in _SCHEMAS.items()
        }

        def write() -> None:
            for name, rows in waiting.items():
                writers[name].write_table(pa.Table.from_pylist(rows, schema=_SCHEMAS[name]))
                rows.clear()

        for belief in beliefs:
            scene, document = belief.partial.scene_id, encode_belief(belief)
            if scene in scenes:
                raise BeliefFileError(
                    f"{folder}: two belief graphs of {scene}", code="scene-twice", where=folder
                )
            scenes.add(scene)
            header = {key: document[key] for key in ("model", "mode", "class_space")}
            for name, rows in _list_rows(document, belief).items():
                waiting[name] += ({"scene_id": scene, **row} for row in rows)
            if len(waiting["nodes"]) >= _ROWS_PER_GROUP:
                write()
        write()
        writers["nodes"].add_key_value_metadata({"bsg.beliefs": encode_json(header)})


def _list_rows(
    document: dict[str, Any], belief: BeliefGraph
) -> dict[str, Iterable[dict[str, Any]]]:
    histograms = (belief.inputs.tolist(), belief.expected, belief.presence)
    return {
        "nodes": _list_node_rows(document),
        "edges": (
            {"source": a, "target": b, "kind": kind} for a, b, kind in sorted(list_edges(document))
        ),
        "histograms": (
            {"node": node, "input": seen, "expected": expected, "presence": presence}
            for node, (seen, expected, presence) in enumerate(zip(*histograms, strict=True))
        ),
    }


def _list_node_rows(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for number, (_, node) in enumerate(list_nodes(document)):
        for name in ("box", "footprint"):
            if node.get(name) is not None:
                node[name] = list(chain.from_iterable(node[name]))
        kinds = node.get("room_type") or {}
        shares = {kinds: 1.0} if isinstance(kinds, str) else kinds
        columns: dict[str, Any] = {"node": number, "room_type": list(shares.items()) or None}
        columns["time"] = read_time(node["time"]) if "time" in node else None
        more = {k: v for k, v in node.items() if v is not None and k not in _SCHEMAS["nodes"].names}
        yield {**node, **columns, "more": encode_json(more, ensure_ascii=False) if more else None}


TABLES = FormatRow("tables", (".tables",), write_all=write_tables, report="nodes.parquet")
