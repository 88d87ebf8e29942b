"""Readers of files that people and other programs write, with inputs that are sound."""

from __future__ import annotations

import gzip
import io
import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from dsg_files import robot_graph

from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.scene.class_map import (
    DEFAULT_CLASS_MAP,
    ClassMap,
    load_class_map,
)
from bsg_data.scene.scene_graph import Box
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.label_space import load_label_space
from bsg_data.sources.source import Source
from bsg_models.belief.belief_graph import believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_robot.graph.document import encode_belief
from bsg_robot.graph.formats import read_belief
from bsg_robot.graph.robot_json import read_robot_graph


@dataclass(frozen=True)
class Reader:
    """A reader.

    Attributes:
        name: of the reader.
        read: puts an input where the reader wants it, an empty folder at first, and reads it.
        seeds: makes sound inputs, as small as they can be.
    """

    name: str
    read: Callable[[Path, bytes], object]
    seeds: Callable[[], tuple[bytes, ...]]


_count = itertools.count()


def put(folder: Path, name: str, data: bytes) -> Path:
    """Write an input as the one file of a folder, under a name that no input before it had.

    Readers that keep what they read would otherwise take two files of one moment for one.
    """
    for path in folder.iterdir():
        path.unlink()
    path = folder / f"{next(_count)}{name}"
    path.write_bytes(data)
    return path


def load_map() -> ClassMap:
    """Load a class map, without what it remembers of the names that it was asked for."""
    class_map = load_class_map(DEFAULT_CLASS_MAP)
    class_map._resolved.clear()
    return class_map


def read_source(source: Source, class_map: ClassMap) -> None:
    """Find the scenes of a source, and read the first ones."""
    for ref in source.find().scenes[:4]:
        source.read(ref, class_map)


def encode(document: object) -> bytes:
    """Return a document as JSON."""
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()


_TABLE = b"""scene,room,category,room_label,floor,floor_area,connected,x,y,z,mine
a,kitchen,chair,kitchen,0,12.5,hall,1,2,0.5,
a,hall,,hallway,0,,kitchen,,,,7
a,,lamp,,,,,,,,
b,1,"a ""b"", c",,,,,,,,
"""


def _to_parquet(columns: dict[str, list[object]]) -> bytes:
    file = io.BytesIO()
    pq.write_table(pa.table(columns), file, write_statistics=False, store_schema=False)
    return file.getvalue()


def _make_mesh() -> bytes:
    import trimesh

    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    colours = np.full((4, 4), 255, dtype=np.uint8)
    faces = [[0, 1, 2], [0, 2, 3]]
    mesh = trimesh.Trimesh(corners, faces, vertex_colors=colours, process=False)
    return bytes(trimesh.Scene(mesh).export(file_type="glb"))


def _make_belief() -> bytes:
    space = load_class_map().space
    room = KnownRoom("kitchen", hidden_share=0.5, label="kitchen", box=Box((0, 0, 0), (1, 1, 2)))
    seen = SeenObject("o", 1, "chair", "chair", space.classes.index("chair"), (1.0, 1.0, 1.0))
    graph = PartialGraph(
        "s", space, 0.5, (room, KnownRoom("hall", hidden_share=1.0)), (seen,), ((1, 2),)
    )
    counts = graph.histograms().astype(float)
    hidden = Expectation(counts, poisson(np.full(counts.shape, 0.75)))
    return encode(encode_belief(believe(graph, hidden, mode="complete", model="m")))


def _read(source: str, suffix: str, **by_first: str) -> Callable[[Path, bytes], object]:
    """Return the reader of a source; its file has a suffix of its own if it begins with a letter.

    The letter `z` stands for gzip.
    """

    def read(folder: Path, data: bytes) -> object:
        first = data[:1].replace(b"\x1f", b"z").decode("latin-1")
        path = put(folder, by_first.get(first, suffix), data)
        return read_source(open_source(source, path), load_map())

    return read


def _read_labels(folder: Path, data: bytes) -> object:
    suffix = ".csv" if b"label," in data[:100] else ".yaml"
    return load_label_space(put(folder, suffix, data))


def _read_belief(folder: Path, data: bytes) -> object:
    return read_belief(put(folder, ".json", data))


def _read_mesh(folder: Path, data: bytes) -> object:
    return survey_mesh(put(folder, ".glb", data), ["FFFFFF"])


def _read_robot(folder: Path, data: bytes) -> object:
    return read_robot_graph(put(folder, "graph.json", data), class_map=load_map())


def _seeds(*data: bytes) -> Callable[[], tuple[bytes, ...]]:
    return lambda: data


_HYDRA = b"label_names:\n- {label: 5, name: chair}\n- {label: 6, name: '7', category: x}\n"
_LABELS = b'label,name,category\n5,chair,\n6,"a, b",sofa\n'
_ROBOT = (Path(__file__).parents[2] / "docs" / "home.json").read_bytes()

READERS = (  # what comes by the network, and one of each kind of file
    Reader("belief-json", _read_belief, lambda: (_make_belief(),)),
    Reader("label-space", _read_labels, _seeds(_HYDRA, _LABELS)),
    Reader("mesh", _read_mesh, lambda: (_make_mesh(),)),
    Reader(
        "object-table",
        _read("table", ".csv", P=".parquet", z=".tsv.gz"),
        _seeds(
            _TABLE,
            gzip.compress(b"scene\troom\tcategory\na\t1\tchair\n", mtime=0),
            _to_parquet({"scene": ["a"], "room": [1.0], "category": ["bed"]}),
        ),
    ),
    Reader(
        "robot-json", _read_robot, _seeds(_ROBOT, b'\xef\xbb\xbf{"scene_id": "s", "rooms": []}')
    ),
    Reader("spark-dsg", _read("spark-dsg", ".json"), _seeds(encode(robot_graph()))),
)
