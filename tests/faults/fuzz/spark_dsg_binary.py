"""Spark-DSG's binary files, which its C++ reads: `bsg_models.belief.hydra`."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from bsg_models.belief.hydra import open_hydra
from fuzz.target import Target, load_map, put


def seeds() -> dict[str, bytes]:
    """Return a graph as spark_dsg writes it."""
    import spark_dsg

    graph = spark_dsg.DynamicSceneGraph()
    room = spark_dsg.RoomNodeAttributes()
    room.name = "kitchen"
    graph.add_node("ROOMS", spark_dsg.NodeSymbol("R", 0), room)
    chair = spark_dsg.ObjectNodeAttributes()
    chair.name = "chair"
    graph.add_node("OBJECTS", spark_dsg.NodeSymbol("O", 0), chair)
    graph.insert_edge(spark_dsg.NodeSymbol("R", 0).value, spark_dsg.NodeSymbol("O", 0).value)
    graph.metadata.add({"labelspaces": json.loads("{}")})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "graph.sparkdsg")
        graph.save(str(path), include_mesh=False)
        return {"graph": path.read_bytes()}


def read(folder: Path, data: bytes) -> object:
    """Read a file."""
    return open_hydra(put(folder, ".sparkdsg", data)).partial(class_map=load_map())


TARGET = Target(
    name="spark-dsg-binary",
    read=read,
    seeds=seeds,
    words=("ROOMS", "OBJECTS", "\x7f\x7f\x7f\x7f\x00", "kitchen", "\x00" * 8),
    most=4_000,
    examples=3,  # a process each
)
