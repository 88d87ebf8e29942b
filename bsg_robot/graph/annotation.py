"""Write beliefs into Hydra's scene graphs by their own library, spark_dsg, and read them back.

The belief graph goes under `metadata.bsg.belief` of the graph. Each room gets its histograms and
each object its class there, too. Blind nodes get a layer of their own, with an edge to the room
where each is expected. All else is as spark_dsg keeps it.
"""

from __future__ import annotations

import string
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bsg_data.files import AnyPath, write_bytes
from bsg_data.sources.dsg_file import DSGFile, parse_dsg
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_robot.errors import HydraError
from bsg_robot.graph.document import decode_belief, encode_belief, write_json
from bsg_robot.graph.formats import FormatRow
from bsg_robot.graph.graph_file import GraphFile, open_graph_file
from bsg_robot.graph.hydra import convert, find_belief, require_spark_dsg

_SYMBOLS = "xyz" + string.ascii_letters  # Hydra uses a, b, … for robots, and B, O, p, R, s, t
_GREEN = np.array([0, 204, 0], dtype=np.uint8)  # of blind nodes in the paper's figures
_LAYER = "BLIND"


def annotate_hydra(belief: BeliefGraph, original: AnyPath | GraphFile, path: AnyPath) -> None:
    """Write a Spark-DSG graph with the beliefs about it added; needs spark_dsg, the extra `hydra`.

    Blind nodes get a layer of their own, `BLIND`; everything else goes into metadata, under
    `bsg.belief`. A belief that the original already holds is replaced. All else is as spark_dsg
    reads and writes it.

    Args:
        belief: about the original.
        original: the graph that was read.
        path: of the file to write.

    Raises:
        HydraError: if the original is no Spark-DSG graph, or lacks a room of the belief, if
            spark_dsg is not installed or cannot load it, or the name does not end in .json.
        BSGError: if it cannot be read or written.
    """
    file = original if isinstance(original, GraphFile) else open_graph_file(Path(original))
    dsg, path = parse_dsg(_require_hydra(file), path=file.path), Path(path)
    rooms, objects = _find_nodes(dsg, belief, file.path)
    if path.suffix != ".json":
        raise HydraError(
            f"{path}: expected a name that ends in .json, by which readers recognise it",
            code="suffix-unknown",
            where=path,
        )
    require_spark_dsg(file.path)
    import spark_dsg

    with tempfile.TemporaryDirectory() as folder:
        plain, written = Path(folder, "original.json"), Path(folder, "annotated.json")
        write_json(file.document, plain)
        plain.write_bytes(convert(plain, named=file.path))  # it can be loaded
        graph = spark_dsg.DynamicSceneGraph.load(str(plain))
        _remove_belief(graph)
        _add_belief(graph, belief, rooms, objects)
        graph.save(str(written), include_mesh=True)
        write_bytes(path, written.read_bytes())


def _require_hydra(file: GraphFile) -> dict[str, Any]:
    if file.document is None:
        raise HydraError(
            f"{file.path}: expected a Spark-DSG graph, found this project's JSON",
            code="dsg-malformed",
            where=file.path,
        )
    document: dict[str, Any] = file.document
    return document


def _find_nodes(
    dsg: DSGFile, belief: BeliefGraph, path: Path
) -> tuple[list[int], list[int | None]]:
    """Return the ids in a file of the rooms and objects of a belief; None for those without one."""
    rooms, objects = (
        {str(node.bsg.get("id", node.symbol)): node.id for node in nodes}
        for nodes in (dsg.rooms, dsg.objects)
    )
    for name in (room.name for room in belief.partial.rooms if room.name not in rooms):
        raise HydraError(
            f"{path}: has no room {name!r}, of which something is believed; use `write_belief` for "
            "a .json",
            code="room-unknown",
            where=path,
        )
    return (
        [rooms[room.name] for room in belief.partial.rooms],
        [objects.get(obj.name) for obj in belief.partial.objects],
    )


def _remove_belief(graph: Any) -> None:
    for node in [*graph.nodes]:
        belief = find_belief({"metadata": dict(node.attributes.metadata.get())})
        if belief is not None and belief.get("kind") == "blind":
            graph.remove_node(node.id)
        elif belief is not None:
            _put(node.attributes, {})


def _put(holder: Any, belief: dict[str, Any]) -> None:
    """Put a belief into the metadata of a graph or of attributes; an empty one removes it."""
    metadata = dict(holder.metadata.get())
    bsg = metadata.get("bsg")
    others = {key: bsg[key] for key in bsg if key != "belief"} if isinstance(bsg, dict) else {}
    holder.metadata.set({**metadata, "bsg": {**others, **({"belief": belief} if belief else {})}})


def _add_belief(
    graph: Any, belief: BeliefGraph, rooms: Sequence[int], objects: Sequence[int | None]
) -> None:
    """Add a belief; `rooms` and `objects` are the nodes of its own, in its order."""
    _put(graph, {"document": encode_belief(belief)})
    classes = belief.partial.class_space.classes
    counts = zip(rooms, belief.expected[1:].tolist(), belief.presence[1:].tolist(), strict=True)
    for room, expected, presence in counts:
        tables = {"expected": expected, "presence": presence}
        histograms = {name: dict(zip(classes, row, strict=True)) for name, row in tables.items()}
        _put(graph.get_node(room).attributes, histograms)
    for node, obj in zip(objects, belief.partial.objects, strict=True):
        if node is not None:
            name = None if obj.class_index is None else classes[obj.class_index]
            _put(graph.get_node(node).attributes, {"category": obj.category, "class": name})
    if belief.blind:
        _add_blind(graph, belief, rooms)


def _add_blind(graph: Any, belief: BeliefGraph, rooms: Sequence[int]) -> None:
    """Add the blind nodes, each at the position of its room."""
    import spark_dsg

    if not graph.has_layer(_LAYER):
        graph.add_layer(_choose_layer(graph, rooms[0]), 0, _LAYER)
    taken = {node.id.category for node in graph.nodes}
    letter = next(letter for letter in _SYMBOLS if letter not in taken)
    for number, node in enumerate(belief.blind):
        room, symbol = rooms[node.room_index - 1], spark_dsg.NodeSymbol(letter, number)
        attributes = spark_dsg.ObjectNodeAttributes()
        attributes.name = belief.partial.class_space.classes[node.class_index]
        attributes.position = graph.get_node(room).attributes.position
        attributes.color = _GREEN
        attributes.is_predicted = True
        expected = {"expected": node.expected, "presence": node.presence}
        on = {} if node.on is None else {"on": node.on}
        _put(attributes, {"kind": "blind", "class": attributes.name, **expected, **on})
        graph.add_node(_LAYER, symbol, attributes)
        graph.insert_edge(room, symbol)


def _choose_layer(graph: Any, room: int) -> int:
    """Return an unused layer below the rooms'.

    In Spark-DSG, the node of the higher layer is the parent of an edge. Above the rooms, blind
    nodes would become the rooms' parents, and the building would lose its rooms.
    """
    taken = {key.layer for key in graph.layer_keys}
    for layer in range(graph.get_node(room).layer.layer):
        if layer not in taken:
            return layer
    raise HydraError("expected a free layer below the rooms', found all taken", code="layers-taken")


def _read(path: Path) -> BeliefGraph:
    document = (find_belief(_require_hydra(open_graph_file(path))) or {}).get("document")
    if document is None:
        raise HydraError(
            f"{path}: expected a belief graph that `annotate_hydra` wrote, found a Spark-DSG "
            "file without one; `read_graph` reads what was seen",
            code="belief-missing",
            where=path,
        )
    return decode_belief(document, path=path)


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), read=_read)
