"""Read a robot's graph, this project's JSON or Spark-DSG's, from a file or standard input."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounds import ROBOT, SPARK_DSG
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.partial_graph import PartialGraph, reclassify
from bsg_data.observation.robot_json import RobotGraphError, parse_robot_graph
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map
from bsg_data.sources.dsg_file import is_dsg
from bsg_data.sources.label_space import load_label_space
from bsg_models.belief.hydra import HydraFile, read_json_text


@dataclass(frozen=True, slots=True)
class GraphFile:
    """A robot's graph with its source."""

    path: Path
    graph: PartialGraph
    hydra: HydraFile | None = None  # None for this project's JSON
    notes: tuple[str, ...] = ()  # what a person should know of how it was read, a sentence each


def open_graph_file(
    path: Path, *, labels: AnyPath | None = None, class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP
) -> GraphFile:
    """Read a robot's graph of either kind, and keep its source; `-` is standard input.

    `labels` is the label space of a Hydra graph, and refused for our JSON.
    """
    is_input = path == Path("-")
    named = Path("standard input") if is_input else path
    document = _parse(_read_standard_input() if is_input else read_json_text(path), named)
    if is_dsg(document):
        file = HydraFile.of(document, path=named)
        space = None if labels is None else load_label_space(labels)
        graph = file.partial(labels=space, class_map=class_map)
        return GraphFile(path, graph, file, tuple(file.notes(space)))
    if labels is not None:
        raise RecipeError(
            f"labels are for Hydra's graphs, and {named} is not one",
            code="labels-unused",
            where=named,
        )
    return GraphFile(path, parse_robot_graph(document, path=named, class_map=class_map))


def read_graph(
    path: AnyPath,
    *,
    labels: AnyPath | None = None,
    class_map: AnyPath | ClassMap = DEFAULT_CLASS_MAP,
) -> PartialGraph:
    """Read a robot's graph: this project's JSON or Spark-DSG's.

    Args:
        path: of the file; `-` is standard input.
        labels: label space of a Hydra graph, as `load_label_space` takes it.
        class_map: map by which names become classes.

    Raises:
        BSGError: if the file cannot be read, or is not a graph.
        RecipeError: if labels are given for a graph that is not Hydra's.
    """
    return open_graph_file(Path(path), labels=labels, class_map=class_map).graph


def use_class_map(graph: PartialGraph, class_map: ClassMap) -> PartialGraph:
    """Return a graph that the default class map read, with the classes of another map."""
    return graph if class_map == load_class_map() else reclassify(graph, class_map)


def _parse(data: bytes | str, path: Path) -> Any:
    """Return the JSON of a graph; a key may be there twice in Spark-DSG alone, as in its parser."""
    try:
        document = parse_json(data)
    except ValueError as error:
        document = None
        with suppress(ValueError):
            document = parse_json(data, once=False)
        if not is_dsg(document):
            raise RobotGraphError(
                f"{path}: no JSON ({str(error)[:200]})", code="json-malformed", where=path
            ) from error
    size = len(data if isinstance(data, bytes) else data.encode())
    if size > ROBOT.bytes and not is_dsg(document):
        raise RobotGraphError(
            f"{path}: expected at most {ROBOT.bytes:,} bytes", code="file-too-large", where=path
        )
    return document


def _read_standard_input() -> bytes:
    stream = getattr(sys.stdin, "buffer", None)  # None also for text that a notebook puts there
    if stream is None or stream.closed:
        raise BSGError(
            "standard input: expected a robot's graph, found it closed; send the graph to it, or "
            "name a file instead of -",
            code="standard-input-closed",
        )
    data = bytes(stream.read(SPARK_DSG.bytes + 1))
    if len(data) > SPARK_DSG.bytes:
        raise BSGError(
            f"standard input: expected at most {SPARK_DSG.bytes:,} bytes", code="file-too-large"
        )
    return data
