"""Write belief graphs of many buildings as parquet tables, and read them back without loss.

`nodes` has one row per building, room, object and blind node; `edges` one per edge; `histograms`
one per building and room. Every table begins with `scene_id`. Nodes are numbered: 0 the building,
then rooms, objects and blind nodes. The headers of the belief graphs are JSON in the metadata of
`nodes`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Floats
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, encode_json
from bsg_data.inputs.bounds import MAX_STREAMED_ROWS
from bsg_data.inputs.documents import parse_json
from bsg_data.inputs.parquet import open_parquet_file
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import RoomType, check_room_type
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode
from bsg_models.belief.consistency import check_beliefs, check_partial
from bsg_models.belief.formats import FormatRow
from bsg_models.belief.header import Header, decode_whole_header, encode_whole_header
from bsg_models.belief.table_rows import SCHEMAS, SceneRows, require_whole, write_rows
from bsg_models.errors import BeliefFileError

Columns = Mapping[str, Any]
KINDS = ("building", "room", "object", "blind")  # in the order of their numbers
_HEADERS = b"bsg.beliefs"


def write_tables(beliefs: Iterable[BeliefGraph], folder: AnyPath) -> None:
    """Write belief graphs as `nodes`, `edges` and `histograms`.parquet, a row group at a time.

    Raises:
        BeliefFileError: if two belief graphs have the same building.
        DatasetError: if they cannot be written.
    """
    folder = Path(folder)
    headers: dict[str, Any] = {}
    packed = _pack_all(beliefs, headers, folder)
    write_rows(packed, folder, metadata=lambda: {"nodes": {_HEADERS: encode_json(headers)}})


def _pack_all(
    beliefs: Iterable[BeliefGraph], headers: dict[str, Any], folder: Path
) -> Iterator[Mapping[str, pa.RecordBatch]]:
    """Yield the rows of each belief graph, table by table; add its header to `headers`."""
    for belief in beliefs:
        scene = belief.partial.scene_id
        if scene in headers:
            raise BeliefFileError(f"{folder}: two belief graphs of {scene}")
        headers[scene] = encode_whole_header(belief)
        batches = {}
        for name, pack in (
            ("nodes", _pack_nodes),
            ("edges", _pack_edges),
            ("histograms", _pack_histograms),
        ):
            columns = pack(belief)
            rows = len(next(iter(columns.values())))
            columns = {"scene_id": pa.repeat(scene, rows), **columns}
            arrays = [pa.array(columns[field.name], field.type) for field in SCHEMAS[name]]
            batches[name] = pa.record_batch(arrays, schema=SCHEMAS[name])
        yield batches


def _pack_nodes(belief: BeliefGraph) -> Columns:
    partial, blind = belief.partial, belief.blind
    rooms, objects, classes = partial.rooms, partial.objects, partial.class_space.classes
    names = [None, *(room.name for room in rooms)]
    rows_of = (1, len(rooms), len(objects), len(blind))

    def column(
        of_rooms: Iterable[Any] | None = None,
        of_objects: Iterable[Any] | None = None,
        of_blind: Iterable[Any] | None = None,
    ) -> list[Any]:
        """Return a column that is empty for the building and every kind left out."""
        values = (None, of_rooms, of_objects, of_blind)
        return list(
            chain.from_iterable(
                [None] * rows if kind is None else kind
                for kind, rows in zip(values, rows_of, strict=True)
            )
        )

    return {
        "node": np.arange(sum(rows_of)),
        "kind": np.repeat(KINDS, rows_of),
        "id": column((room.name for room in rooms), (obj.name for obj in objects)),
        "room": column(of_objects=(names[obj.room_index] for obj in objects)),
        "category": column(of_objects=(obj.raw_category for obj in objects)),
        "corrected": column(of_objects=(obj.category for obj in objects)),
        "class": column(
            of_objects=(
                None if obj.class_index is None else classes[obj.class_index] for obj in objects
            ),
            of_blind=(classes[node.class_index] for node in blind),
        ),
        "expected": column(of_blind=(node.expected for node in blind)),
        "presence": column(of_blind=(node.presence for node in blind)),
        "visited": column(room.visited for room in rooms),
        "hidden_share": column(room.hidden_share for room in rooms),
        "hidden_share_sd": column(room.hidden_share_sd for room in rooms),
        "label": column(room.label for room in rooms),
        "position": column((room.position for room in rooms), (obj.position for obj in objects)),
        "box": column(
            None if room.box is None else (*room.box.minimum, *room.box.maximum) for room in rooms
        ),
        "footprint": column(
            None if room.footprint is None else tuple(chain.from_iterable(room.footprint))
            for room in rooms
        ),
        "floor_index": column(room.floor_index for room in rooms),
        "floor_area": column(room.floor_area for room in rooms),
        "room_type": column(_pack_room_type(room.room_type) for room in rooms),
    }


def _pack_room_type(room_type: RoomType | None) -> list[tuple[str, float]] | None:
    if room_type is None:
        return None
    return [(room_type, 1.0)] if isinstance(room_type, str) else list(room_type.items())


def _pack_edges(belief: BeliefGraph) -> Columns:
    rooms, objects = len(belief.partial.rooms), len(belief.partial.objects)
    parents = [0] * rooms
    parents += [obj.room_index for obj in belief.partial.objects]
    parents += [node.room_index for node in belief.blind]
    kinds = ["contains"] * (rooms + objects) + ["expects"] * len(belief.blind)
    edges = [(a, b, kind) for b, (a, kind) in enumerate(zip(parents, kinds, strict=True), 1)]
    for a, b in dict.fromkeys(belief.partial.adjacency):
        edges += [(a, b, "adjacent"), (b, a, "adjacent")]
    edges.sort()
    return {
        "source": [a for a, _, _ in edges],
        "target": [b for _, b, _ in edges],
        "kind": [kind for _, _, kind in edges],
    }


def _pack_histograms(belief: BeliefGraph) -> Columns:
    return {
        "node": np.arange(len(belief.expected)),
        "input": _lists(belief.partial.histograms(), pa.int32()),
        "expected": _lists(belief.expected, pa.float64()),
        "presence": _lists(belief.presence, pa.float64()),
    }


def _lists(values: npt.NDArray[Any], kind: pa.DataType) -> pa.ListArray:
    """Return the rows of an array `[N, C]` as lists."""
    rows, columns = values.shape
    flat = pa.array(np.ascontiguousarray(values).ravel(), kind)
    return pa.ListArray.from_arrays(np.arange(rows + 1, dtype=np.int32) * columns, flat)


def read_tables(folder: AnyPath) -> Iterator[BeliefGraph]:
    """Yield the belief graphs of `write_tables`, in the order of their scene ids.

    Rows may be in any order.

    Raises:
        BeliefFileError: if a table is missing or is not a belief table.
    """
    folder = Path(folder)
    try:
        require_whole(folder)
        headers = _read_headers(folder)
        scenes = [header.partial.scene_id for header in headers]
        parts = {name: SceneRows(folder / f"{name}.parquet", name, scenes) for name in SCHEMAS}
    except BeliefFileError as error:
        if not all((folder / f"{name}.parquet").is_file() for name in SCHEMAS):
            raise BeliefFileError(f"{folder}: no tables of belief graphs ({error})") from error
        raise
    except DatasetError as error:
        raise BeliefFileError(str(error)) from error
    except _DAMAGE as error:
        raise BeliefFileError(f"{folder}: no tables of belief graphs ({error!r})") from error
    for number, header in enumerate(headers):
        where = _place(folder, header.partial.scene_id)
        try:
            belief = _unpack(header, *(parts[name].read(number) for name in SCHEMAS))
        except _DAMAGE as error:
            raise BeliefFileError(f"{where}: rows are damaged ({error!r})") from error
        check_partial(belief.partial, path=where)
        check_beliefs(belief, path=where)
        yield belief


_DAMAGE = (
    OSError,
    pa.ArrowException,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)


def _place(folder: Path, scene: str) -> Path:
    """Return the folder and building, as errors name them."""
    return Path(f"{folder}, building {scene}")


def _read_headers(folder: Path) -> list[Header]:
    """Return the headers in the order of their scene ids."""
    place = folder / "nodes.parquet"
    with open_parquet_file(place, most=MAX_STREAMED_ROWS, error=BeliefFileError) as file:
        metadata = file.schema_arrow.metadata or {}
    headers = []
    for scene, entry in sorted(parse_json(metadata[_HEADERS]).items()):
        header = decode_whole_header(entry, path=_place(folder, scene))
        if header.partial.scene_id != scene:
            raise ValueError(f"the metadata has {header.partial.scene_id!r} under {scene!r}")
        headers.append(header)
    return headers


def _unpack(header: Header, nodes: pa.Table, edges: pa.Table, histograms: pa.Table) -> BeliefGraph:
    """Return the belief graph of one building's rows."""
    kinds = nodes["kind"].to_pylist()
    _, rooms, objects, blind = (kinds.count(kind) for kind in KINDS)
    if kinds != [kind for kind in KINDS for _ in range(kinds.count(kind))] or kinds[0] != KINDS[0]:
        raise ValueError("expected the building, then rooms, objects and blind nodes")
    for name, table, number in (
        ("nodes", nodes, len(kinds)),
        ("histograms", histograms, 1 + rooms),
    ):
        if table["node"].to_pylist() != list(range(number)):
            raise ValueError(f"{name}: expected one row per node, 0 to {number - 1}")
    links = list(_rows(edges, ("source", "target", "kind")))
    parents = {target: source for source, target, kind in links if kind != "adjacent"}
    numbers = {name: index for index, name in enumerate(header.class_space.classes)}
    return BeliefGraph(
        partial=PartialGraph(
            scene_id=header.partial.scene_id,
            class_space=header.class_space,
            hidden_share=header.partial.hidden_share,
            rooms=_unpack_rooms(nodes.slice(1, rooms)),
            objects=tuple(
                SeenObject(name, parents[number], raw, category, class_index, _point(position))
                for number, (name, raw, position, category, class_index) in enumerate(
                    _read_objects(header, nodes.slice(1 + rooms, objects), numbers), 1 + rooms
                )
            ),
            adjacency=tuple(sorted((a, b) for a, b, kind in links if kind == "adjacent" and a < b)),
            building_kind=header.partial.building_kind,
            source=header.partial.source,
        ),
        expected=_matrix(histograms["expected"], len(numbers)),
        presence=_matrix(histograms["presence"], len(numbers)),
        blind=tuple(
            BlindNode(parents[number], numbers[name], expected, presence)
            for number, (name, expected, presence) in enumerate(
                _rows(nodes.slice(1 + rooms + objects, blind), ("class", "expected", "presence")),
                1 + rooms + objects,
            )
        ),
        mode=header.mode,
        model=header.model,
    )


def _read_objects(
    header: Header, nodes: pa.Table, numbers: Mapping[str, int]
) -> Iterator[tuple[Any, ...]]:
    """Yield id, category, position, corrected name and class of objects."""
    rows = _rows(nodes, ("id", "category"), ("position", "corrected", "class"))
    if header.class_map is None:
        for *known, corrected, name in rows:
            yield *known, corrected, None if name is None else numbers[name]
        return
    class_map = load_class_map(header.class_map)
    for name, raw, position, *_ in rows:
        known_as = class_map.classify(raw)
        yield name, raw, position, known_as.category, known_as.class_index


def _unpack_rooms(nodes: pa.Table) -> tuple[KnownRoom, ...]:
    known = ("id", "hidden_share", "visited")
    said = (
        *("label", "position", "box", "footprint", "floor_index", "floor_area", "room_type"),
        "hidden_share_sd",
    )
    rows = _rows(nodes, known, said)
    return tuple(
        KnownRoom(
            *(name, share, visited, label, _point(position)),
            box=None if box is None else Box(_point(box[:3]), _point(box[3:])),
            footprint=None if outline is None else _corners(outline),
            floor_index=floor,
            floor_area=area,
            room_type=None if kind is None else check_room_type(dict(kind)),
            hidden_share_sd=sd or 0.0,
        )
        for name, share, visited, label, position, box, outline, floor, area, kind, sd in rows
    )


def _rows(
    table: pa.Table, required: Sequence[str], optional: Sequence[str] = ()
) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of some columns; the required columns have no nulls."""
    for name in required:
        if table[name].null_count:
            raise ValueError(f"{name}: {table[name].null_count} nulls")
    return zip(*(table[name].to_pylist() for name in (*required, *optional)), strict=True)


def _point(values: Sequence[float] | None) -> Any:
    """Return a position, None if it is not known."""
    if values is None:
        return None
    x, y, z = map(float, values)
    return x, y, z


def _corners(values: Sequence[float]) -> tuple[tuple[float, float], ...]:
    return tuple(zip(map(float, values[::2]), map(float, values[1::2]), strict=True))


def _matrix(lists: pa.ChunkedArray, columns: int) -> Floats:
    """Return a column of lists as an array `[N, C]`."""
    if lists.null_count or (pc.list_value_length(lists).to_numpy() != columns).any():
        raise ValueError(f"expected histograms of {columns} classes")
    flat = pc.list_flatten(lists).to_numpy()
    return np.array(flat, dtype=np.float64).reshape(len(lists), columns)


TABLES = FormatRow("tables", (".tables",), write_all=write_tables, read_all=read_tables)
