"""Read Hydra's scene graphs (Spark-DSG) as partial graphs, and write beliefs into them.

`annotate_hydra` writes Hydra's graph unchanged, with the beliefs added. `write_hydra` writes a
belief graph of another origin as a new file. `read_hydra_belief` reads both back exactly, and
`strip_hydra` removes what was added.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bsg_data.files import AnyPath, encode_json, write_bytes
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

_BELOW = 2**56 - 1  # mask for the number of a symbol


def read_hydra(
    path: AnyPath,
    *,
    labels: AnyPath | None = None,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
) -> PartialGraph:
    """Read a partial graph from a Spark-DSG file.

    Rooms are the nodes of the layer `ROOMS`. Objects are those of `OBJECTS` below a room, directly
    or through places; other objects belong to the building. Ids are symbols such as `R(3)`. The
    label or the name of a room gives its type. A room counts as passed through, with an unknown
    hidden share, unless its metadata say `{"bsg": {"hidden_share": ...}}`, or how the robot looked
    at it (`floor_in_view`, `walls_in_view`, `seconds_inside`).

    Args:
        path: of the file: `.json`, `.json.gz`, or with spark_dsg `.sparkdsg`.
        labels: label space of its objects, as `load_label_space` takes it; None uses the names in
            the file.
        class_map: map that gives the objects their classes.

    Raises:
        HydraError: if it cannot be read.
        ClassMapError: if there is no such label space.
    """
    path = Path(path)
    space = None if labels is None else load_label_space(labels)
    return open_hydra(path).partial(labels=space, class_map=class_map)


def annotate_hydra(belief: BeliefGraph, original: AnyPath | HydraFile, path: AnyPath) -> None:
    """Write a Spark-DSG graph unchanged, byte for byte, with the beliefs about it added.

    Blind nodes get a layer of their own, `BLIND`; everything else goes into metadata, under
    `bsg.belief`. A belief that the original already holds is replaced. A packed original is written
    unpacked, and a binary one as the JSON that spark_dsg makes of it.

    Args:
        belief: about the original.
        original: the graph that was read.
        path: of the file to write.

    Raises:
        HydraError: if the original lacks a room of the belief, or the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    path = Path(path)
    _check_name(path)
    file = original if isinstance(original, HydraFile) else open_hydra(Path(original))
    write_bytes(path, file.annotated(belief).encode())


def strip_hydra(original: AnyPath, path: AnyPath) -> None:
    """Write a Spark-DSG graph without what `annotate_hydra` added: the original.

    Raises:
        HydraError: if it is not a Spark-DSG graph, or the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    original, path = Path(original), Path(path)
    _check_name(path)
    write_bytes(path, strip_annotation(open_hydra(original).text).encode())


def write_hydra(belief: BeliefGraph, path: AnyPath) -> None:
    """Write a belief graph as a new Spark-DSG graph; `read_hydra_belief` reads it back exactly.

    Raises:
        HydraError: if the name does not end in .json.
        DatasetError: if it cannot be written.
    """
    path = Path(path)
    _check_name(path)
    text = encode_json(encode_dsg(belief.partial), separators=(",", ":"))
    annotate_hydra(belief, HydraFile(path, text, parse_dsg(text, path=path)), path)


def read_hydra_belief(path: AnyPath) -> BeliefGraph:
    """Read the belief graph that `annotate_hydra` or `write_hydra` wrote into a Spark-DSG graph.

    Raises:
        HydraError: if there is none.
        BeliefFileError: if it is damaged.
    """
    path = Path(path)
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
    """Read a numbered graph, which early versions of `write_hydra` wrote.

    `bsg` was the header in the graph, the attributes in a node, and the kind in an edge.
    """
    document: Any = parse_json(file.text, once=False)
    try:
        nodes = sorted(document["nodes"], key=lambda node: node["id"] & _BELOW)
        attributes = [node["attributes"]["metadata"]["bsg"] for node in nodes]
        edges = []
        for edge in document["edges"]:
            # A parent has the lower number; spark_dsg may have swapped the ends of an edge.
            source, target = sorted((edge["source"] & _BELOW, edge["target"] & _BELOW))
            edges.append((source, target, edge["info"]["metadata"]["bsg"]["kind"]))
    except (LookupError, TypeError) as error:
        raise HydraError(f"{file.path}: expected nodes and edges with their metadata") from error
    return decode_nodes(file.graph.said, attributes, edges, path=file.path)


def _check_name(path: Path) -> None:
    if path.suffix != ".json":
        raise HydraError(
            f"{path}: expected a name that ends in .json, by which readers recognise it"
        )


SPARK_DSG = FormatRow("spark-dsg", (".dsg.json",), write=write_hydra, read=read_hydra_belief)
