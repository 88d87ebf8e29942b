"""Hydra's scene graphs (Spark-DSG): partial graphs in, the same graphs out with what is believed.

A graph of Hydra's comes back as it was, with beliefs in it (`annotate_hydra`); a belief graph of
another origin becomes a new file (`write_hydra`). `read_hydra_belief` reads both back exactly, and
`strip_hydra` takes out again what was put in.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bsg_data.files import encode_json, write_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.sources.dsg_file import parse_dsg
from bsg_data.sources.label_space import load_label_space
from bsg_models.belief.annotation import strip_annotation
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.document import decode_belief
from bsg_models.belief.dsg_document import encode_dsg
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.hydra_file import HydraFile, open_hydra
from bsg_models.belief.nodes import decode_nodes
from bsg_models.errors import HydraError

_BELOW = 2**56 - 1  # the number of a symbol


def read_hydra(
    path: Path, *, labels: str | None = None, class_map: str | ClassMap = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Read a partial graph from a Spark-DSG file.

    Rooms are those of the layer `ROOMS`, objects those of `OBJECTS` under a room, directly or over
    places; what is under none belongs to the building. Their ids are their symbols, `R(3)`. A room
    is of the kind that its label or its name says. It has been passed through, and may hide
    anything, unless its metadata say `{"bsg": {"hidden_share": ...}}`, or how the robot looked at
    it (`floor_in_view`, `walls_in_view`, `seconds_inside`).

    Args:
        path: of the file: `.json`, `.json.gz`, or with spark_dsg `.sparkdsg`.
        labels: the label space of its objects, as `load_label_space` takes it; None takes the
            names in the file.
        class_map: whose classes the objects get.

    Raises:
        HydraError: if it cannot be read.
        ClassMapError: if there is no such label space.
    """
    space = None if labels is None else load_label_space(labels)
    return open_hydra(path).partial(labels=space, class_map=class_map)


def annotate_hydra(belief: BeliefGraph, original: Path | HydraFile, path: Path) -> None:
    """Write a Spark-DSG graph as it was, byte for byte, with what is believed about it.

    Blind nodes are in a layer of their own, `BLIND`; the rest is in metadata, under `bsg.belief`.
    A belief that is in the original already is replaced. A packed original is written unpacked, a
    binary one as JSON, as spark_dsg converts it.

    Args:
        belief: about what is in the original.
        original: the graph that was read.
        path: of the file to write.

    Raises:
        HydraError: if the original has no such room, or the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    _check_name(path)
    file = original if isinstance(original, HydraFile) else open_hydra(original)
    write_bytes(path, file.annotated(belief).encode())


def strip_hydra(original: Path, path: Path) -> None:
    """Write a Spark-DSG graph without what `annotate_hydra` put in: what it was before.

    Raises:
        HydraError: if it is none, or the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    _check_name(path)
    write_bytes(path, strip_annotation(open_hydra(original).text).encode())


def write_hydra(belief: BeliefGraph, path: Path) -> None:
    """Write a belief graph as a new Spark-DSG graph; `read_hydra_belief` reads it back exactly.

    Raises:
        HydraError: if the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    _check_name(path)
    text = encode_json(encode_dsg(belief.partial), separators=(",", ":"))
    annotate_hydra(belief, HydraFile(path, text, parse_dsg(text, path=path)), path)


def read_hydra_belief(path: Path) -> BeliefGraph:
    """Read the belief graph that `annotate_hydra` or `write_hydra` put into a Spark-DSG graph.

    Raises:
        HydraError: if there is none.
        BeliefFileError: if it is damaged.
    """
    file = open_hydra(path)
    if file.document is not None:
        return decode_belief(file.document, path=path)
    if file.is_numbered:
        return _read_numbered(file)
    raise HydraError(
        f"{path}: expected a belief graph that `annotate_hydra` or `write_hydra` wrote, found a "
        "Spark-DSG file without one; `read_hydra` reads what was seen"
    )


def _read_numbered(file: HydraFile) -> BeliefGraph:
    """Read what `write_hydra` wrote before annotations: a graph of nodes that are numbered.

    `bsg` was the header in the graph, the node's attributes in a node, and its kind in an edge.
    """
    document: Any = parse_json(file.text, once=False)
    try:
        nodes = sorted(document["nodes"], key=lambda node: node["id"] & _BELOW)
        attributes = [node["attributes"]["metadata"]["bsg"] for node in nodes]
        edges = []
        for edge in document["edges"]:
            # A parent has the lower number; spark_dsg may have turned an edge round.
            source, target = sorted((edge["source"] & _BELOW, edge["target"] & _BELOW))
            edges.append((source, target, edge["info"]["metadata"]["bsg"]["kind"]))
    except (LookupError, TypeError) as error:
        raise HydraError(f"{file.path}: expected nodes and edges with their metadata") from error
    return decode_nodes(file.graph.said, attributes, edges, path=file.path)


def _check_name(path: Path) -> None:
    if path.suffix != ".json":
        raise HydraError(f"{path}: expected a name that ends in .json, by which readers know it")


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), write=write_hydra, read=read_hydra_belief)
