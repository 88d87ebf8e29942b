"""Read a robot's graph, this project's JSON or Spark-DSG's, from a file or standard input."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounds import ROBOT, SPARK_DSG
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import RobotGraphError, parse_robot_graph
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.sources.dsg_file import is_dsg, parse_document
from bsg_data.sources.label_space import load_label_space
from bsg_models.belief.hydra_file import BOM, HydraFile, read_text

STANDARD_INPUT = Path("-")


@dataclass(frozen=True, slots=True)
class GraphFile:
    """A robot's graph with its source.

    Attributes:
        graph: what the robot has seen.
        hydra: the Spark-DSG file of a robot; None for this project's JSON, and for a numbered graph
            that `write_hydra` wrote.
        notes: what a person should know about how it was read, a sentence each.
    """

    graph: PartialGraph
    hydra: HydraFile | None = None
    notes: tuple[str, ...] = ()


def open_graph_file(
    path: Path, *, labels: AnyPath | None = None, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
) -> GraphFile:
    """Read a robot's graph of either kind, and keep its source.

    Args:
        path: of the file; `-` is standard input.
        labels: label space of a Hydra graph, as `load_label_space` takes it.
        class_map: map by which names become classes.

    Raises:
        BSGError: if the file cannot be read, or is not a graph.
        RecipeError: if labels are given for a graph that is not Hydra's.
    """
    if path == STANDARD_INPUT:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder, "standard input")
            copy.write_bytes(_read_standard_input())
            return open_graph_file(copy, labels=labels, class_map=class_map)
    text = read_text(path)
    try:
        document = parse_json(text.removeprefix(BOM), once=False)
    except ValueError as error:
        raise BSGError(f"{path}: no JSON ({str(error)[:200]})") from error
    if is_dsg(document):
        file = HydraFile(path, text, parse_document(document, path=path))
        space = None if labels is None else load_label_space(labels)
        return GraphFile(
            file.partial(labels=space, class_map=class_map),
            None if file.is_numbered else file,
            file.notes(space),
        )
    if labels is not None:
        raise RecipeError(f"labels are for Hydra's graphs, and {path} is not one")
    if len(text) > ROBOT.bytes or len(text.encode()) > ROBOT.bytes:
        raise RobotGraphError(f"{path}: expected at most {ROBOT.bytes:,} bytes")
    try:
        said = parse_json(text.removeprefix(BOM))  # refuses a repeated key
    except ValueError as error:
        raise RobotGraphError(f"{path}: no JSON ({error})") from error
    return GraphFile(parse_robot_graph(said, path=path, class_map=class_map))


def _read_standard_input() -> bytes:
    """Return the bytes of standard input, up to one more than a graph may have.

    Raises:
        BSGError: if it is closed.
    """
    stream = getattr(sys.stdin, "buffer", None)  # None also for text that a notebook puts there
    if stream is None or stream.closed:
        raise BSGError(
            "standard input: expected a robot's graph, found it closed; send the graph to it, or "
            "name a file instead of -"
        )
    return bytes(stream.read(SPARK_DSG.bytes + 1))


def read_graph(
    path: AnyPath,
    *,
    labels: AnyPath | None = None,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
) -> PartialGraph:
    """Read a robot's graph of either kind; see `open_graph_file`."""
    path = Path(path)
    return open_graph_file(path, labels=labels, class_map=class_map).graph
