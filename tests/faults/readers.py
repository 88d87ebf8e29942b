"""All readers of files that people and other programs write, with inputs that are sound."""

from __future__ import annotations

import gzip
import io
import itertools
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from dsg_files import robot_graph
from house_files import HOUSE

from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.scene.class_map import (
    DEFAULT_CLASS_MAP,
    ClassMap,
    load_class_map,
    parse_own_map,
    read_own_map,
)
from bsg_data.scene.scene_graph import Box, Room, SceneGraph
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.hm3d import parse_annotation
from bsg_data.sources.hm3d_stats import HEADER, MEMBER
from bsg_data.sources.label_space import load_label_space
from bsg_data.sources.layout_files import read_layout
from bsg_data.sources.room_layouts import _lay_out
from bsg_data.sources.source import Source
from bsg_models.belief.belief_graph import believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_models.evaluation.prediction_files import read_predictions
from bsg_models.zoo.config import find_config, override, read_config, validate_config, write_toml
from bsg_robot.graph.document import encode_belief
from bsg_robot.graph.formats import read_belief
from bsg_robot.graph.robot_json import read_robot_graph


@dataclass(frozen=True)
class Reader:
    """A reader.

    Attributes:
        name: of the reader; that of its folder in `corpus/`, too.
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


_ANNOTATION = 'HM3D Semantic Annotations\n1,1003,"wall",0\n2,0F3A9C,"chair, ü",4\n7,FF,"",-1\n'
_SCENES = {
    "Rs_int": {"kitchen_0": {"stove-abcdef": 1, "straight_chair-amgwaw": 2}, "bedroom_0": {}},
    "Rs_garden": {"kitchen_0": {"stove-abcdef": 1}, "garden_0": {"tree-ccc": 3}},
    "house_double_floor_upper": {"bedroom_10": {"shower_stall-gqxmqf": 1}},
}
_FLOORS = {"room|4": ((0, 0), (2, 0), (2, 1), (1, 2)), "room|2": ((2, 0), (4, 0), (4, 1))}
_PROCTHOR = {
    "rooms": [
        {
            "id": name,
            "roomType": "Bedroom",
            "floorPolygon": [{"x": x, "y": 0, "z": z} for x, z in corners],
        }
        for name, corners in _FLOORS.items()
    ],
    "doors": [{"id": "door|2|4", "room0": "room|4", "room1": "room|2"}],
    "walls": [{"roomId": "room|4", "polygon": [{"x": 0, "y": 2.5, "z": 0}]}],
    "objects": [
        {"id": "4|0|0", "assetId": "Bed_25", "position": {"x": 1, "y": 0.5, "z": 1}, "children": []}
    ],
}
_TABLE = b"""scene,room,category,room_label,floor,floor_area,connected,x,y,z,mine
a,kitchen,chair,kitchen,0,12.5,hall,1,2,0.5,
a,hall,,hallway,0,,kitchen,,,,7
a,,lamp,,,,,,,,
b,1,"a ""b"", c",,,,,,,,
"""
_LAYOUT = b"""rooms:
  room_1: {label: kitchen, centroid: {x: 1.0, y: 1.25, z: -2.0}, dims: {x: 2, y: 2.5, z: 4}}
  room_2: {label: "h\xc3\xa4llway", centroid: {x: 4, y: 4, z: -2}, dims: {x: 2, y: 2, z: 1}}
connections: [[1, 2]]
"""
_BUILDING = SceneGraph(
    scene_id="s",
    source="hm3d",
    source_version=None,
    source_split=None,
    annotation_sha256="0" * 64,
    rooms=tuple(Room(number, number) for number in range(1, 4)),
    objects=(),
    class_map="hm3d45-v1",
)
_PREDICTIONS = {
    "scene_id": ["a", "a"],
    "draw": [0, 0],
    "node_index": [1, 1],
    "class": ["chair", "bed"],
    "presence": [0.5, 0.25],
    "expected": [0.75, 0.25],
}


def _pack(data: bytes) -> bytes:
    """Return the zip of a table of statistics, not compressed: its bytes stand as they are."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(zipfile.ZipInfo(MEMBER), data)
    return file.getvalue()


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


def _read_class_map(folder: Path, data: bytes) -> object:
    """Read a map, whose files stand one after another with a byte of 0 between."""
    for path in folder.iterdir():
        path.unlink()
    suffixes = (".csv", ".classes.csv", ".structure.csv")
    for suffix, text in zip(suffixes, data.split(b"\0"), strict=False):
        (folder / f"mine{suffix}").write_bytes(text)
    class_map = parse_own_map(read_own_map(folder / "mine.csv"))
    return [class_map.classify(name) for name in ("chairs", "", "kitchen chair 2", "unknown/x")]


def _read_configuration(folder: Path, data: bytes) -> object:
    """Read a file, whose settings come after it, each behind a byte of 0."""
    text, *settings = data.split(b"\0")
    path = put(folder, ".toml", text)
    tables = override(read_config(path), [one.decode("utf-8", "replace") for one in settings])
    return validate_config(tables, source=str(path))


def _read(source: str, suffix: str, **by_first: str) -> Callable[[Path, bytes], object]:
    """Return the reader of a source; its file has a suffix of its own if it begins with a letter.

    The letter `z` stands for gzip.
    """

    def read(folder: Path, data: bytes) -> object:
        first = data[:1].replace(b"\x1f", b"z").decode("latin-1")
        path = put(folder, by_first.get(first, suffix), data)
        return read_source(open_source(source, path), load_map())

    return read


def _read_annotation(folder: Path, data: bytes) -> object:
    return parse_annotation(data, path=folder / "a.semantic.txt")


def _read_statistics(folder: Path, data: bytes) -> object:
    packed = data if data[:1] == b"P" else _pack(data)
    path = put(folder, "HM3DSem-v0.2.zip", packed)
    return read_source(open_source("hm3d-stats", path), load_map())


def _read_labels(folder: Path, data: bytes) -> object:
    suffix = ".csv" if b"label," in data[:100] else ".yaml"
    return load_label_space(put(folder, suffix, data))


def _read_belief(folder: Path, data: bytes) -> object:
    return read_belief(put(folder, ".json", data))


def _read_layout(folder: Path, data: bytes) -> object:
    return _lay_out(_BUILDING, read_layout(put(folder, ".yaml", data)))


def _read_mesh(folder: Path, data: bytes) -> object:
    return survey_mesh(put(folder, ".glb", data), ["FFFFFF"])


def _read_predictions(folder: Path, data: bytes) -> object:
    return read_predictions(put(folder, ".parquet", data))


def _read_robot(folder: Path, data: bytes) -> object:
    return read_robot_graph(put(folder, "graph.json", data), class_map=load_map())


def _seeds(*data: bytes) -> Callable[[], tuple[bytes, ...]]:
    return lambda: data


_HOUSE = HOUSE.encode()
_HYDRA = b"label_names:\n- {label: 5, name: chair}\n- {label: 6, name: '7', category: x}\n"
_STATISTICS = f'{",".join(HEADER)},\n00001-abcdefghi01,-1,1,1,lamp_9\ns,5,1,2,"a, b_7:c_8"\n'
_MAP = b'raw_category,category,class\nchair,chair,chair\n"a, b",sofa,\nWall,wall,\n'
_STRUCTURE = b"category\nwall\n"
_LABELS = b'label,name,category\n5,chair,\n6,"a, b",sofa\n'
_CLASSES = b"index,class,definition\n0,chair,A seat.\n1,bed,To sleep in.\n"
_HOUSES = encode(_PROCTHOR) + b"\n" + encode(_PROCTHOR).replace(b"room|4", b"room|7") + b"\n"
_ROBOT = (Path(__file__).parents[2] / "docs" / "home.json").read_bytes()

READERS = (
    Reader(
        "annotation",
        _read_annotation,
        _seeds(_ANNOTATION.encode(), _ANNOTATION.replace("\n", "\r\n").encode("utf-8-sig")),
    ),
    Reader(
        "behavior", _read("behavior", ".json"), _seeds(encode({"success": True, "scenes": _SCENES}))
    ),
    Reader("belief-json", _read_belief, lambda: (_make_belief(),)),
    Reader("class-map", _read_class_map, _seeds(_MAP, b"\0".join((_MAP, _CLASSES, _STRUCTURE)))),
    Reader(
        "configuration",
        _read_configuration,
        lambda: (write_toml(find_config("ceci-sage")).encode(),),
    ),
    Reader(
        "house",
        _read("mp3d", ".house", z=".house.gz"),
        _seeds(_HOUSE, gzip.compress(_HOUSE, mtime=0)),
    ),
    Reader("label-space", _read_labels, _seeds(_HYDRA, _LABELS)),
    Reader("layout", _read_layout, _seeds(_LAYOUT)),
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
    Reader("predictions", _read_predictions, _seeds(_to_parquet(_PREDICTIONS))),
    Reader(
        "procthor",
        _read("procthor", ".jsonl", z=".jsonl.gz", **{"[": ".json"}),
        _seeds(_HOUSES, b"[" + encode(_PROCTHOR) + b"]", gzip.compress(_HOUSES, mtime=0)),
    ),
    Reader(
        "robot-json", _read_robot, _seeds(_ROBOT, b'\xef\xbb\xbf{"scene_id": "s", "rooms": []}')
    ),
    Reader("spark-dsg", _read("spark-dsg", ".json"), _seeds(encode(robot_graph()))),
    Reader(
        "statistics-zip",
        _read_statistics,
        _seeds(_STATISTICS.encode(), _pack(_STATISTICS.encode())),
    ),
)
