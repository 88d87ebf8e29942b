"""A robot's graph of either kind: our JSON, or Spark-DSG's; from a file, or from standard input."""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import BSGError, RecipeError
from bsg_data.observation.hidden_share import VAGUE
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import read_robot_graph
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.sources.annotation_files import read_bytes
from bsg_data.sources.dsg_file import is_dsg
from bsg_data.sources.label_space import load_label_space
from bsg_data.sources.spark_dsg import MAX_BYTES
from bsg_models.belief.hydra_file import BINARY, HydraFile, open_hydra

STANDARD_INPUT = Path("-")
_NAMED = 10  # rooms in a note


@dataclass(frozen=True, slots=True)
class GraphFile:
    """A robot's graph that was read.

    Attributes:
        graph: what the robot has seen.
        hydra: the file as it is, of a robot's Spark-DSG graph; None of our JSON, and of a numbered
            graph of ours.
        notes: what a person should know of how it was read, a sentence each.
    """

    graph: PartialGraph
    hydra: HydraFile | None = None
    notes: tuple[str, ...] = ()

    def list_notes(self, *, told: bool) -> tuple[str, ...]:
        """Return the notes, with one about the shares of rooms if nobody `told` them."""
        if told:
            return self.notes
        if self.hydra is not None and not self.hydra.says_shares:
            return (*self.notes, "any room may hide anything; --hidden-share says better")
        unsure = [room for room in self.graph.rooms if room.share != VAGUE and room.hidden_share_sd]
        if not unsure:
            return self.notes
        shares = ", ".join(f"{room.label or room.name} {room.share}" for room in unsure[:_NAMED])
        more = f", and {len(unsure) - _NAMED:,} more" if len(unsure) > _NAMED else ""
        return (*self.notes, f"hidden shares that are not sure: {shares}{more}")


def open_graph_file(
    path: Path, *, labels: str | None = None, class_map: str | ClassMap = DEFAULT_CLASS_MAP
) -> GraphFile:
    """Read a robot's graph of either kind, and keep what it was read from.

    Args:
        path: of the file; `-` is standard input.
        labels: label space of a Hydra graph, as `load_label_space` takes it.
        class_map: that its names are read with.

    Raises:
        BSGError: if it cannot be read, or is no graph.
        RecipeError: if labels are given for a graph that is not Hydra's.
    """
    if path == STANDARD_INPUT:
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder, "standard input")
            copy.write_bytes(sys.stdin.buffer.read())
            return open_graph_file(copy, labels=labels, class_map=class_map)
    if _is_hydra(path):
        file = open_hydra(path)
        space = None if labels is None else load_label_space(labels)
        return GraphFile(
            file.partial(labels=space, class_map=class_map),
            None if file.is_numbered else file,
            file.notes(space),
        )
    if labels is not None:
        raise RecipeError(f"labels are for Hydra's graphs, and {path} is none")
    return GraphFile(read_robot_graph(path, class_map=class_map))


def read_graph(
    path: Path, *, labels: str | None = None, class_map: str | ClassMap = DEFAULT_CLASS_MAP
) -> PartialGraph:
    """Read a robot's graph of either kind; see `open_graph_file`."""
    return open_graph_file(path, labels=labels, class_map=class_map).graph


def _is_hydra(path: Path) -> bool:
    if path.suffix == BINARY:
        return True
    try:
        return is_dsg(json.loads(read_bytes(path, most=MAX_BYTES)))
    except (ValueError, RecursionError) as error:
        raise BSGError(f"{path}: no JSON ({str(error)[:200]})") from error
