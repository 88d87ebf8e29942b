"""A robot's graph of either kind: our JSON, or Spark-DSG's; from a file, or from standard input."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from bsg_data.errors import BSGError, RecipeError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import read_robot_graph
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_models.belief.hydra import read_hydra

STANDARD_INPUT = Path("-")


def read_graph(
    path: Path, *, labels: str | None = None, class_map: str | ClassMap = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Read a robot's graph of either kind.

    Args:
        path: of the file; `-` is standard input.
        labels: label space of a Hydra graph: `ade20k` or `mpcat40`.
        class_map: that its names are read with.

    Raises:
        BSGError: if it cannot be read, or is no graph.
        RecipeError: if labels are given for a graph that is not Hydra's.
    """
    if path == STANDARD_INPUT:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder, "standard input")
            copy.write_bytes(sys.stdin.buffer.read())
            return read_graph(copy, labels=labels, class_map=class_map)
    try:
        document = {} if path.suffix == ".sparkdsg" else json.loads(path.read_bytes())
    except OSError as error:
        raise BSGError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise BSGError(f"{path}: no JSON ({error})") from error
    if path.suffix == ".sparkdsg" or "SPARK_DSG_header" in document:
        return read_hydra(path, labels=labels, class_map=class_map)
    if labels is not None:
        raise RecipeError(f"labels are for Hydra's graphs, and {path} is none")
    return read_robot_graph(path, class_map=class_map)
