"""The dataset format, version 1: one explicit Arrow schema per table.

The writer, the reader, `bsg-data check` and the tables of the docs all read these constants. The
metadata of a field has its meaning and its unit. A column that is added is nullable: a file without
it is read as if it were null.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import pyarrow as pa

_NO_GEOMETRY = "without geometry"


def _field(
    name: str, kind: pa.DataType, meaning: str, *, unit: str = "", null: str = ""
) -> pa.Field:
    """Make a field; `null` says when it is null, and only then may it be."""
    metadata = {"meaning": meaning, "unit": unit, "null": null}
    return pa.field(
        name, kind, nullable=bool(null), metadata={k: v for k, v in metadata.items() if v}
    )


def _points(*meanings: tuple[str, str]) -> list[pa.Field]:
    return [
        _field(f"{name}_{axis}", pa.float64(), f"{what}, {shown}", unit="m", null=_NO_GEOMETRY)
        for name, what in meanings
        for axis, shown in (("x", "x"), ("y", "y"), ("z", "z (up)"))
    ]


def _position(what: str, box: str) -> list[pa.Field]:
    return _points(
        ("centroid", what),
        ("box_min", f"lowest corner of {box}"),
        ("box_max", f"highest corner of {box}"),
    )


_SCENE_ID = _field("scene_id", pa.string(), "the building, e.g. 00006-HkseAnWCgqk")

SCENES = pa.schema(
    [
        _SCENE_ID,
        _field(
            "building",
            pa.string(),
            "key of the building: two scenes of one key are the same building",
            null="it is scene_id",
        ),
        _field("source", pa.string(), "kind of source, e.g. hm3d; the manifest has its terms"),
        _field("source_version", pa.string(), "its version, e.g. v0.2", null="it does not say"),
        _field("source_split", pa.string(), "the source's own split", null="it does not say"),
        _field("class_map", pa.string(), "the class map that its names were read with"),
        _field("building_kind", pa.string(), "home, office, school, …", null="it does not say"),
        _field("num_rooms", pa.int32(), "rooms R"),
        _field("num_objects", pa.int32(), "objects O, with or without a class"),
        _field("num_classified", pa.int32(), "objects with a class"),
        _field("has_geometry", pa.bool_(), "whether any room or object has a place"),
        _field(
            "up_axis",
            pa.string(),
            "axis that points up in the mesh: x, y, z, -x, -y or -z",
            null="without a mesh",
        ),
        _field("annotation_sha256", pa.string(), "hash of the annotation that it was read from"),
    ]
)

ROOMS = pa.schema(
    [
        _SCENE_ID,
        _field("room_index", pa.int32(), "node index, 1..R in the order of the region ids"),
        _field("region_id", pa.int32(), "the annotation's region id; 0 is a real room"),
        _field(
            "label",
            pa.string(),
            "what kind of room it is, in the words of mappings/room-labels-v1.csv",
            null="not known",
        ),
        _field("source_label", pa.string(), "what the source calls it", null="nothing"),
        *_position("centre of its box", "its box"),
        _field("floor_index", pa.int16(), "level of its floor, 0 at the bottom", null=_NO_GEOMETRY),
        _field("floor_z", pa.float64(), "height of its floor", unit="m", null=_NO_GEOMETRY),
        _field("floor_area", pa.float64(), "area of its floor", unit="m²", null="not known"),
        _field(
            "footprint",
            pa.list_(pa.field("element", pa.float64(), nullable=False)),
            "its outline from above, convex, against the clock: x0, y0, x1, y1, …",
            unit="m",
            null=_NO_GEOMETRY,
        ),
    ]
)

OBJECTS = pa.schema(
    [
        _SCENE_ID,
        _field("object_index", pa.int32(), "1..O in the order of the instance ids"),
        _field("instance_id", pa.int32(), "the annotation's own id"),
        _field("room_index", pa.int32(), "its room, 1..R; 0 in the null region (the building's)"),
        _field("raw_category", pa.string(), "its name exactly as annotated"),
        _field(
            "category", pa.string(), "corrected name by the class map", null="name not in the map"
        ),
        _field(
            "role",
            pa.string(),
            "classified, left-out (outside the classes), structure (of the building), nameless or "
            "unmapped (name not in the map)",
        ),
        _field("class_index", pa.uint8(), "index of its class, 0..C-1", null="outside the classes"),
        _field("class", pa.string(), "name of its class", null="outside the classes"),
        _field("colour", pa.string(), "RRGGBB in the semantic mesh", null="the source has none"),
        *_position("centroid of its surface", "its box"),
        _field("area", pa.float64(), "of its surface", unit="m²", null=_NO_GEOMETRY),
        *_points(
            ("part_min", "lowest corner of the box of its largest connected part"),
            ("part_max", "highest corner of the box of its largest connected part"),
        ),
        _field("has_geometry", pa.bool_(), "whether the object has a box"),
    ]
)

EDGES = pa.schema(
    [
        _SCENE_ID,
        _field("kind", pa.string(), "contains (directed) or adjacent (undirected, stored once)"),
        _field("source_kind", pa.string(), "building or room: what contains, or one of two rooms"),
        _field("source_index", pa.int32(), "0 of the building; room_index of a room"),
        _field("target_kind", pa.string(), "room or object: what is contained, or the other room"),
        _field("target_index", pa.int32(), "room_index or object_index"),
        _field(
            "method",
            pa.string(),
            "how it is known: annotation; of adjacency layout, door, stairs, boxes, robot or given",
        ),
        _field(
            "distance_m",
            pa.float64(),
            "between the centroids of two adjacent rooms",
            unit="m",
            null="contains",
        ),
    ]
)

SPLITS = pa.schema(
    [
        _SCENE_ID,
        _field("split", pa.string(), "train, val or test; with --folds K: fold-0 .. fold-(K-1)"),
    ]
)

TABLES: Mapping[str, pa.Schema] = MappingProxyType(
    {"scenes": SCENES, "rooms": ROOMS, "objects": OBJECTS, "edges": EDGES}
)


def pairs_schema(num_classes: int) -> pa.Schema:
    """Return the schema of the pairs for histograms of `num_classes` classes."""
    flags = pa.list_(pa.field("element", pa.bool_(), nullable=False), num_classes)
    view = (
        _field("hidden_share", pa.float32(), "share of its objects that the node hides, as told"),
        _field(
            "withheld",
            flags,
            "classes that the input shows in searched rooms only; absence elsewhere says nothing",
        ),
    )
    histogram = pa.list_(pa.field("element", pa.uint16(), nullable=False), num_classes)
    return pa.schema(
        [
            _SCENE_ID,
            _field("split", pa.string(), "split or fold of the building"),
            _field("draw", pa.int32(), "number of the mask, from 0"),
            _field("node_index", pa.int32(), "node of interest: 0 building, 1..R rooms"),
            _field("visited", pa.bool_(), "whether the mask lets the robot enter the room"),
            *view,
            _field("input", histogram, "histogram of what the mask leaves: E′ × O′"),
            _field("target", histogram, "histogram of what is there: E × O"),
        ]
    )


def describe_fields(schema: pa.Schema) -> list[tuple[str, str, str, str, str]]:
    """Return (name, type, unit, meaning, null when) of every field, for docs and cards."""
    rows = []
    for field in schema:
        words = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
        kind = _type_name(field.type)
        rows.append(
            (field.name, kind, words.get("unit", ""), words["meaning"], words.get("null", ""))
        )
    return rows


def _type_name(kind: pa.DataType) -> str:
    if pa.types.is_fixed_size_list(kind):
        return f"list<{kind.value_type}>[{kind.list_size}]"
    if pa.types.is_list(kind):
        return f"list<{kind.value_type}>"
    return str(kind)
