"""Belief graphs as JSON, as networkx graphs and as parquet tables, and back without loss."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

import networkx as nx
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import Field, ValidationError

from bsg_data.dataset.manifest import ClassMapEntry
from bsg_data.errors import BSGError, MismatchError
from bsg_data.files import write_bytes
from bsg_data.observation.robot_json import encode_robot_graph, parse_robot_graph
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import list_class_maps
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode, Mode

FORMAT = "bsg-belief-graph"
TABLES = ("nodes", "edges", "histograms")
_PARTIAL_HEAD = ("format", "version", "scene_id", "hidden_share")


class BeliefFileError(BSGError):
    """Report a belief graph that cannot be read."""


class _Blind(Record):
    room: int = Field(ge=1)
    class_name: str = Field(alias="class")
    expected: float = Field(ge=0, allow_inf_nan=False)
    presence: float = Field(ge=0, le=1)


class _Document(Record):
    format: str
    version: int
    model: str
    mode: Mode
    class_map: ClassMapEntry
    partial: dict[str, Any]
    expected: list[list[Annotated[float, Field(ge=0, allow_inf_nan=False)]]]
    presence: list[list[Annotated[float, Field(ge=0, le=1)]]]
    blind: list[_Blind]


def encode_belief(belief: BeliefGraph) -> dict[str, Any]:
    """Return a belief graph as a JSON document; `decode_belief` reads it back."""
    classes = belief.partial.class_map.classes
    return {
        **_head(belief),
        "partial": encode_robot_graph(belief.partial),
        "expected": belief.expected.tolist(),
        "presence": belief.presence.tolist(),
        "blind": [
            {
                "room": node.room_index,
                "class": classes[node.class_index],
                "expected": node.expected,
                "presence": node.presence,
            }
            for node in belief.blind
        ],
    }


def _head(belief: BeliefGraph) -> dict[str, Any]:
    """Return what is said once of a belief graph."""
    return {
        "format": FORMAT,
        "version": 1,
        "model": belief.model,
        "mode": belief.mode,
        "class_map": belief.partial.class_map.model_dump(mode="json"),
    }


def decode_belief(said: Any, *, path: Path) -> BeliefGraph:
    """Return the belief graph of a JSON document.

    Raises:
        BeliefFileError: naming what is wrong with it.
        MismatchError: if it is of a class map that is not here.
    """
    try:
        found = _Document.model_validate(said)
    except ValidationError as error:
        raise BeliefFileError(f"{path}: {name_fault(error)}") from error
    if (found.format, found.version) != (FORMAT, 1):
        raise BeliefFileError(f"{path}: expected {FORMAT} 1, found {found.format} {found.version}")
    if found.class_map.version not in list_class_maps():
        raise MismatchError(f"{path}: class map {found.class_map.version!r} is no published one")
    partial = parse_robot_graph(found.partial, path=path, class_map=found.class_map.version)
    if partial.class_map != found.class_map:
        raise MismatchError(f"{path}: class map {found.class_map.version} has changed since")
    shape = (len(partial.rooms) + 1, len(partial.class_map.classes))
    for table in (found.expected, found.presence):
        if len(table) != shape[0] or any(len(row) != shape[1] for row in table):
            raise BeliefFileError(f"{path}: expected histograms of {shape[0]} × {shape[1]}")
    expected, presence = np.array(found.expected), np.array(found.presence)
    if not (expected >= partial.histograms()).all():
        raise BeliefFileError(f"{path}: fewer objects are expected than were seen")
    index = {name: number for number, name in enumerate(partial.class_map.classes)}
    blind = []
    for node in found.blind:
        if node.class_name not in index or node.room > len(partial.rooms):
            raise BeliefFileError(f"{path}: a blind node of {node.class_name!r} in {node.room}")
        if node.presence != presence[node.room, index[node.class_name]]:
            raise BeliefFileError(f"{path}: a blind node in {node.room} is not as sure as its room")
        blind.append(BlindNode(node.room, index[node.class_name], node.expected, node.presence))
    return BeliefGraph(partial, expected, presence, tuple(blind), found.mode, found.model)


def write_belief(belief: BeliefGraph, path: Path) -> None:
    """Write a belief graph as JSON, whole or not at all."""
    text = json.dumps(encode_belief(belief), ensure_ascii=False, separators=(",", ":"))
    write_bytes(path, text.encode())


def read_belief(path: Path) -> BeliefGraph:
    """Read a belief graph from JSON.

    Raises:
        BeliefFileError: if it cannot be read.
    """
    try:
        return decode_belief(json.loads(path.read_text("utf-8")), path=path)
    except OSError as error:
        raise BeliefFileError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise BeliefFileError(f"{path}: no JSON ({error})") from error


def to_networkx(belief: BeliefGraph) -> nx.DiGraph:
    """Return a directed graph of building, rooms, objects and blind nodes.

    Nodes are numbered: 0 the building, then rooms, objects and blind nodes. Each has `kind`
    (`building`, `room`, `object` or `blind`) and what it has; `graph.graph` says the rest. Edges
    have `kind`: `contains`, `expects` (room to blind node) or `adjacent` (both ways).
    """
    partial, classes = belief.partial, belief.partial.class_map.classes
    document = encode_robot_graph(partial)
    graph = nx.DiGraph(**_head(belief), partial={key: document[key] for key in _PARTIAL_HEAD})
    nodes = [("building", {}), *(("room", room) for room in document["rooms"])]
    for number, (kind, words) in enumerate(nodes):
        beliefs = {
            "expected": belief.expected[number].tolist(),
            "presence": belief.presence[number].tolist(),
        }
        graph.add_node(number, kind=kind, **words, **beliefs)
        if number:
            graph.add_edge(0, number, kind="contains")
    first = len(nodes)
    for number, (obj, words) in enumerate(
        zip(partial.objects, document["objects"], strict=True), first
    ):
        name = None if obj.class_index is None else classes[obj.class_index]
        graph.add_node(number, kind="object", **words, **{"class": name})
        graph.add_edge(obj.room_index, number, kind="contains")
    first += len(partial.objects)
    for number, node in enumerate(belief.blind, first):
        words = {"class": classes[node.class_index], "expected": node.expected}
        graph.add_node(number, kind="blind", **words, presence=node.presence)
        graph.add_edge(node.room_index, number, kind="expects")
    for a, b in partial.adjacency:
        graph.add_edge(a, b, kind="adjacent")
        graph.add_edge(b, a, kind="adjacent")
    return graph


def from_networkx(graph: nx.DiGraph) -> BeliefGraph:
    """Return the belief graph of a graph of `to_networkx`.

    Raises:
        BeliefFileError: if it is none.
    """
    path = Path("networkx graph")
    try:
        words = {key: value for key, value in graph.graph.items() if key != "partial"}
        kinds: dict[str, list[tuple[int, dict[str, Any]]]] = {}
        for number, data in sorted(graph.nodes(data=True)):
            own = {key: value for key, value in data.items() if key != "kind"}
            kinds.setdefault(data["kind"], []).append((number, own))
        rooms = [own for _, own in kinds.get("room", [])]
        beliefs = [kinds["building"][0][1], *rooms]
        plain = ("expected", "presence")
        document = {
            **graph.graph["partial"],
            "rooms": [{k: v for k, v in room.items() if k not in plain} for room in rooms],
            "objects": [
                {k: v for k, v in own.items() if k != "class"} for _, own in kinds.get("object", [])
            ],
            "adjacency": [
                [rooms[a - 1]["id"], rooms[b - 1]["id"]]
                for a, b, kind in sorted(graph.edges(data="kind"))
                if kind == "adjacent" and a < b
            ],
        }
        blind = [
            {"room": next(iter(graph.predecessors(number))), **own}
            for number, own in kinds.get("blind", [])
        ]
        said = {
            **words,
            "partial": document,
            **{key: [node[key] for node in beliefs] for key in plain},
            "blind": blind,
        }
    except (KeyError, IndexError, TypeError, StopIteration) as error:
        raise BeliefFileError(f"no belief graph of `to_networkx`: {error!r}") from error
    return decode_belief(said, path=path)


def write_tables(beliefs: Iterable[BeliefGraph], folder: Path) -> None:
    """Write belief graphs as `nodes`, `edges` and `histograms`.parquet.

    Every table begins with `scene_id`; node numbers are those of `to_networkx`. The JSON of what
    has no row of its own is in the metadata of `nodes`.
    """
    columns: dict[str, dict[str, list[Any]]] = {
        name: {field.name: [] for field in schema} for name, schema in _SCHEMAS.items()
    }
    words = {}

    def append(table: str, **row: Any) -> None:
        for name, values in columns[table].items():
            values.append(row.get(name))

    for belief in beliefs:
        graph = to_networkx(belief)
        scene = belief.partial.scene_id
        if scene in words:
            raise BeliefFileError(f"{folder}: two belief graphs of {scene}")
        words[scene] = graph.graph
        inputs = belief.partial.histograms()
        for number, data in sorted(graph.nodes(data=True)):
            single = {k: v for k, v in data.items() if k not in ("expected", "presence", "box")}
            beliefs_of = (
                (data["expected"], data["presence"]) if data["kind"] == "blind" else (None, None)
            )
            box = None if data.get("box") is None else [v for end in data["box"] for v in end]
            outline = data.get("footprint")
            append(
                "nodes",
                **{
                    **single,
                    "scene_id": scene,
                    "node": number,
                    "expected": beliefs_of[0],
                    "presence": beliefs_of[1],
                    "box": box,
                    "position": None if data.get("position") is None else list(data["position"]),
                    "footprint": None if outline is None else [v for end in outline for v in end],
                },
            )
            if number <= len(belief.partial.rooms):
                append(
                    "histograms",
                    scene_id=scene,
                    node=number,
                    input=inputs[number].tolist(),
                    expected=data["expected"],
                    presence=data["presence"],
                )
        for a, b, kind in sorted(graph.edges(data="kind")):
            append("edges", scene_id=scene, source=a, target=b, kind=kind)
    folder.mkdir(parents=True, exist_ok=True)
    for name, schema in _SCHEMAS.items():
        meta = {"bsg.beliefs": json.dumps(words)} if name == "nodes" else {}
        table = pa.Table.from_pydict(columns[name], schema=schema.with_metadata(meta))
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd")
        write_bytes(folder / f"{name}.parquet", sink.getvalue().to_pybytes())


def read_tables(folder: Path) -> Iterator[BeliefGraph]:
    """Yield the belief graphs of `write_tables`, in the order of their scene ids.

    Raises:
        BeliefFileError: if a table is missing or not one of ours.
    """
    try:
        tables = {name: pq.read_table(folder / f"{name}.parquet") for name in TABLES}
        words = json.loads(tables["nodes"].schema.metadata[b"bsg.beliefs"])
        rows = {name: table.to_pylist() for name, table in tables.items()}
        if {row["scene_id"] for row in rows["nodes"]} != set(words):
            raise ValueError("the rows are of other scenes than the metadata")
        graphs = [_assemble(scene, said, rows) for scene, said in sorted(words.items())]
    except (OSError, pa.ArrowInvalid, LookupError, TypeError, ValueError, AttributeError) as error:
        raise BeliefFileError(f"{folder}: no tables of belief graphs ({error!r})") from error
    yield from map(from_networkx, graphs)


def _assemble(
    scene: str, said: dict[str, Any], rows: dict[str, list[dict[str, Any]]]
) -> nx.DiGraph:
    """Return the networkx graph of one scene of the tables."""
    histograms = {r["node"]: r for r in rows["histograms"] if r["scene_id"] == scene}
    graph = nx.DiGraph(**said)
    for row in rows["nodes"]:
        if row["scene_id"] != scene:
            continue
        keys = _KEYS[row["kind"]]
        data = {key: row[key] for key in keys}
        if data.get("box") is not None:
            data["box"] = [row["box"][:3], row["box"][3:]]
        if data.get("footprint") is not None:
            ends = row["footprint"]
            data["footprint"] = list(zip(ends[::2], ends[1::2], strict=True))
        if row["kind"] in ("building", "room"):
            beliefs = histograms[row["node"]]
            data |= {key: beliefs[key] for key in ("expected", "presence")}
        graph.add_node(row["node"], kind=row["kind"], **data)
    for row in rows["edges"]:
        if row["scene_id"] == scene:
            graph.add_edge(row["source"], row["target"], kind=row["kind"])
    return graph


_ROOM = ("id", "visited", "hidden_share", "label", "position", "box", "footprint", "floor_index")
_KEYS = {
    "building": (),
    "room": _ROOM,
    "object": ("id", "room", "category", "position", "class"),
    "blind": ("class", "expected", "presence"),
}
_METRES = pa.list_(pa.float64())
_SCHEMAS = {
    "nodes": pa.schema(
        [
            ("scene_id", pa.string()),
            ("node", pa.int32()),
            ("kind", pa.string()),
            ("id", pa.string()),
            ("room", pa.string()),
            ("category", pa.string()),
            ("class", pa.string()),
            ("expected", pa.float64()),
            ("presence", pa.float64()),
            ("visited", pa.bool_()),
            ("hidden_share", pa.float64()),
            ("label", pa.string()),
            ("position", _METRES),
            ("box", _METRES),
            ("footprint", _METRES),
            ("floor_index", pa.int16()),
        ]
    ),
    "edges": pa.schema(
        [
            ("scene_id", pa.string()),
            ("source", pa.int32()),
            ("target", pa.int32()),
            ("kind", pa.string()),
        ]
    ),
    "histograms": pa.schema(
        [
            ("scene_id", pa.string()),
            ("node", pa.int32()),
            ("input", pa.list_(pa.int32())),
            ("expected", pa.list_(pa.float64())),
            ("presence", pa.list_(pa.float64())),
        ]
    ),
}
