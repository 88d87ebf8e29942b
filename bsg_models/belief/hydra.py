"""Write beliefs into Hydra's scene graphs (Spark-DSG).

`annotate_hydra` writes Hydra's graph with the beliefs added: every value, key and order stays. The
belief graph is read back exactly.
"""

from __future__ import annotations

from pathlib import Path

from bsg_data.files import AnyPath
from bsg_data.sources.dsg_file import parse_dsg
from bsg_models.belief.annotation import Document, annotate, find_document
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import decode_belief, write_json
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.graph_file import GraphFile, open_graph_file
from bsg_models.errors import HydraError


def annotate_hydra(belief: BeliefGraph, original: AnyPath | GraphFile, path: AnyPath) -> None:
    """Write a Spark-DSG graph with the beliefs about it added; its own values and order stay.

    Blind nodes get a layer of their own, `BLIND`; everything else goes into metadata, under
    `bsg.belief`. A belief that the original already holds is replaced. A packed original is written
    unpacked, and a binary one as the JSON that spark_dsg makes of it.

    Args:
        belief: about the original.
        original: the graph that was read.
        path: of the file to write.

    Raises:
        HydraError: if the original is no Spark-DSG graph, or lacks a room of the belief, or the
            name does not end in .json.
        BSGError: if it cannot be read or written.
    """
    file = original if isinstance(original, GraphFile) else open_graph_file(Path(original))
    _write(_annotated(_require_hydra(file), belief, file.path), Path(path))


def _require_hydra(file: GraphFile) -> Document:
    if file.document is None:
        raise HydraError(
            f"{file.path}: expected a Spark-DSG graph, found this project's JSON",
            code="dsg-malformed",
            where=file.path,
        )
    document: Document = file.document
    return document


def _annotated(document: Document, belief: BeliefGraph, path: Path) -> Document:
    graph = parse_dsg(document, path=path)
    rooms, objects = (
        {str(node.said.get("id", node.symbol)): node.id for node in nodes}
        for nodes in (graph.rooms, graph.objects)
    )
    strange = [room.name for room in belief.partial.rooms if room.name not in rooms]
    if strange:
        raise HydraError(
            f"{path}: has no room {strange[0]!r}, of which something is believed; "
            "use `write_belief` for a .json",
            code="room-unknown",
            where=path,
        )
    return annotate(
        document,
        belief,
        rooms=[rooms[room.name] for room in belief.partial.rooms],
        objects=[objects.get(obj.name) for obj in belief.partial.objects],
    )


def _read(path: Path) -> BeliefGraph:
    document = find_document(_require_hydra(open_graph_file(path)))
    if document is None:
        raise HydraError(
            f"{path}: expected a belief graph that `annotate_hydra` wrote, found a Spark-DSG "
            "file without one; `read_graph` reads what was seen",
            code="belief-missing",
            where=path,
        )
    return decode_belief(document, path=path)


def _write(document: Document, path: Path) -> None:
    if path.suffix != ".json":
        raise HydraError(
            f"{path}: expected a name that ends in .json, by which readers recognise it",
            code="suffix-unknown",
            where=path,
        )
    write_json(document, path)


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), read=_read)
