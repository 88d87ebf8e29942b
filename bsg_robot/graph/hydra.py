"""Read Hydra's graphs (Spark-DSG): in the words of a robot's JSON, and from binary files.

A robot states facts that Spark-DSG has no field for, such as the `hidden_share` of a room, in
metadata under `bsg`, with the keys of this project's JSON; facts of the graph go into `partial`.
What `bsg_robot.graph.annotation` adds is under `bsg.belief`.

Binary files are converted in a separate process with limits. Their C++ reader trusts the lengths in
a file: a kilobyte can ask for all memory, which no exception stops. A process has limits, and only
the process ends when it reaches them.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from bsg_data.errors import ask_to_install
from bsg_data.sources.dsg_file import DSGFile, DSGNode
from bsg_data.sources.label_space import LabelSpace, name_object
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN
from bsg_robot.errors import HydraError
from bsg_robot.graph.robot_json import (
    GRAPH_WORDS,
    OBJECT_WORDS,
    ROOM_WORDS,
    RobotGraphError,
)

_MEMORY = 4 * 2**30  # bytes, besides Python and spark_dsg; a real graph takes a tenth
_SECONDS = 120
_CODE = (
    "import sys; path, written, *sys.path = sys.argv[1:]\n"
    "from bsg_robot.graph.hydra import _run\n"
    "_run(path, written)\n"
)
_LISTED = 10  # labels in a note
_PATH = ("metadata", "bsg", "belief")  # of a belief in a graph, or in a node's attributes
_OURS = ("belief", "partial")  # keys of an annotation, and of facts of the graph
_COMPARED = 1000  # foreign keys in metadata that are compared with ours; more are somebody's data
_TELLING = 5  # letters from which a similar key is no accident


def describe_hydra(dsg: DSGFile, labels: LabelSpace | None, path: Path) -> dict[str, Any]:
    """Return Hydra's graph in the form of a robot's JSON; its metadata take precedence."""
    partial = dsg.bsg.get("partial")
    graph = partial if isinstance(partial, dict) else {}
    _refuse_misspelt({f"{path}: partial": graph}, GRAPH_WORDS)
    for kind, nodes, keys in (
        ("room", dsg.rooms, ROOM_WORDS),
        ("object", dsg.objects, OBJECT_WORDS),
    ):
        _refuse_misspelt({f"{path}: {kind} {node.symbol!r}": node.bsg for node in nodes}, keys)
    rooms = [_describe_room(room) for room in dsg.rooms]
    names = [room["id"] for room in rooms]
    return {
        **_take(graph, GRAPH_WORDS),
        "rooms": rooms,
        "objects": [_describe_object(obj, names, labels) for obj in dsg.objects],
        "adjacency": [[names[a], names[b]] for a, b in dsg.adjacency],
    }


def _describe_room(node: DSGNode) -> dict[str, Any]:
    called = node.label_name or node.name
    return {
        "id": node.symbol,
        "label": called,
        "position": node.position,
        "box": None if node.box is None else (node.box.minimum, node.box.maximum),
        **_take(node.bsg, ROOM_WORDS),
    }


def _describe_object(node: DSGNode, rooms: list[str], labels: LabelSpace | None) -> dict[str, Any]:
    return {
        "id": node.symbol,
        "room": None if node.room is None else rooms[node.room],
        "category": _name_object(node, labels),
        "position": node.position,
        **_take(node.bsg, OBJECT_WORDS),
    }


def _name_object(node: DSGNode, labels: LabelSpace | None) -> str:
    """Return the name of an object; the one of our own annotation if nobody else names it."""
    name, belief = name_object(node, labels), node.bsg.get("belief")
    own = belief.get("category") if isinstance(belief, dict) else None
    return own if isinstance(own, str) and name in ("", f"label {node.label}") else name


def _take(metadata: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: metadata[key] for key in keys if key in metadata}


def _refuse_misspelt(said: Mapping[str, Mapping[str, Any]], keys: tuple[str, ...]) -> None:
    """Refuse keys in metadata that are nearly ours; all others are the user's.

    A key is compared once in a graph, however many nodes have it.
    """
    foreign = {
        key: where
        for where, metadata in said.items()
        for key in metadata
        if key not in keys and key not in _OURS
    }
    for key, where in islice(foreign.items(), _COMPARED):
        if hint := ask_if_meant(key, [word for word in keys if len(word) >= _TELLING]):
            raise RobotGraphError(
                f"{where}: {key[:SHOWN]!r} is no key; {hint}", code="key-unknown", where=where
            )


def note_hydra(dsg: DSGFile, labels: LabelSpace | None) -> Iterator[str]:
    """Yield what a person should know about how Hydra's graph is read, a sentence each."""
    if not dsg.rooms:
        yield "it has no rooms (layer ROOMS): beliefs are about the building only"
    elif astray := sum(obj.room is None for obj in dsg.objects):
        yield f"{astray} of {_count(len(dsg.objects))} under no room, counted for the building only"
    if dsg.links:
        edges = "1 edge" if dsg.links == 1 else f"{dsg.links:,} edges"
        yield (
            f"{edges} between objects not read: Spark-DSG does not say which of the two lies on "
            "the other; say `on` in the metadata of an object (docs/belief.md)"
        )
    if dsg.lost:
        edges = "1 edge" if dsg.lost == 1 else f"{dsg.lost:,} edges"
        yield f"{edges} left out: a node of each is not in the file"
    bare = [obj for obj in dsg.objects if not (obj.label_name or obj.name or "category" in obj.bsg)]
    labelled = [obj for obj in bare if obj.label is not None]
    named = Counter((obj.label, _name_object(obj, labels)) for obj in labelled)
    found = sorted(pair for pair in named if pair[1] != f"label {pair[0]}")
    if found and labels is not None:
        pairs = ", ".join(f"{label} is {name}" for label, name in found[:_LISTED])
        yield f"the file does not name its labels; by {labels.name}, {pairs}"
    if missing := sorted(set(named) - set(found)):
        numbers = ", ".join(str(label) for label, _ in missing[:_LISTED])
        yield (
            f"{_count(sum(named[pair] for pair in missing))} with labels that nobody names "
            f"({numbers}); name them by --labels: mpcat40, ade20k, or the file of the label "
            "space that Hydra ran with (config/label_spaces/NAME.yaml)"
        )
    if silent := len(bare) - len(labelled):
        yield f"{_count(silent)} with neither a label nor a name"


def _count(objects: int) -> str:
    return "1 object" if objects == 1 else f"{objects:,} objects"


def find_belief(holder: Any) -> dict[str, Any] | None:
    """Return what an annotation added to a graph, or to the attributes of a node."""
    for key in _PATH:
        holder = holder.get(key) if isinstance(holder, dict) else None
    return holder if isinstance(holder, dict) else None


def require_spark_dsg(path: Path) -> None:
    """Refuse what only Hydra's own library can do, if it is not installed."""
    if importlib.util.find_spec("spark_dsg") is None:
        raise HydraError(
            f"{path}: binary graphs, and beliefs in Hydra's graphs, need spark_dsg; use .json, or "
            f"{ask_to_install('hydra')}",
            code="library-missing",
            where=path,
        )


def convert(path: Path, *, named: Path) -> bytes:
    """Return the JSON of a graph, binary or not, as spark_dsg makes it; errors name a path."""
    require_spark_dsg(named)
    with tempfile.TemporaryDirectory() as folder:  # the writer chooses names, and fails silently
        written = Path(folder, "graph.json")
        # Isolated: never import modules from the working directory.
        command = [sys.executable, "-I", "-c", _CODE, str(path.absolute()), str(written), *sys.path]
        try:
            subprocess.run(  # noqa: S603
                command, check=True, capture_output=True, timeout=2 * _SECONDS, cwd=folder
            )
            return written.read_bytes()
        except (subprocess.SubprocessError, OSError) as error:
            raise HydraError(
                f"{named}: expected a Spark-DSG file, found one that spark_dsg cannot load within "
                f"{_MEMORY // 2**30} GiB and {_SECONDS} s; save it again by spark_dsg",
                code="dsg-unloadable",
                where=named,
            ) from error


def _run(path: str, written: str) -> None:
    """Convert a graph in this process, which is limited from now on."""
    import spark_dsg

    _bound()
    spark_dsg.DynamicSceneGraph.load(path).save(written, include_mesh=True)


def _bound() -> None:
    try:
        import resource
    except ImportError:  # not on Windows: there the caller's timeout is the only limit
        return
    status = Path("/proc/self/statm")
    taken = int(status.read_text().split()[0]) * resource.getpagesize() if status.exists() else 0
    resource.setrlimit(resource.RLIMIT_AS, (taken + _MEMORY, taken + _MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
