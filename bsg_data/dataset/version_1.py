"""Read datasets of format version 1 as version 2.

Version 1 had one source and one class map. It had no roles of objects, and no labels and areas of
rooms. Its edges used node indices over the whole graph: 0 the building, 1..R the rooms, R+1..R+O
the objects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.dataset.schema import EDGES, OBJECTS, ROOMS, SCENES
from bsg_data.errors import ClassMapError
from bsg_data.geometry.placement import measure_area
from bsg_data.scene.class_map import ClassMap, Role, is_nameless, load_class_map, published_maps
from bsg_data.scene.class_space import hash_classes
from bsg_data.scene.room_label import LAYOUTS, label_of
from bsg_data.sources.catalogue import find_terms

_NEW = {"class_map", "building_kind", "role", "floor_area"}  # columns that version 1 has not


def _without_new(schema: pa.Schema) -> pa.Schema:
    return pa.schema([field for field in schema if field.name not in _NEW])


_OLD_EDGES = pa.schema(
    [
        EDGES.field("scene_id"),
        pa.field("source", pa.int32(), nullable=False),
        pa.field("target", pa.int32(), nullable=False),
        *(EDGES.field(name) for name in ("kind", "method", "distance_m")),
    ]
)
_OLD_LABEL = pa.field("label", pa.string(), nullable=False)  # always `room`
TABLES_1: Mapping[str, pa.Schema] = MappingProxyType(
    {
        "scenes": _without_new(SCENES),
        "rooms": _without_new(ROOMS).set(ROOMS.get_field_index("label"), _OLD_LABEL),
        "objects": _without_new(OBJECTS),
        "edges": _OLD_EDGES,
    }
)


def convert_manifest(said: dict[str, Any]) -> dict[str, Any]:
    """Convert a manifest of version 1 to version 2.

    Missing keys stay missing; the record refuses them later.
    """
    source, class_map = said.pop("source", None), said.pop("class_map", None)
    options = said.pop("options", None)
    if not all(isinstance(part, dict) for part in (source, class_map, options)):
        return said
    classes = class_map.get("classes")
    named = isinstance(classes, list) and all(isinstance(name, str) for name in classes)
    terms = find_terms(str(source.get("kind")))
    said["class_space"] = {
        "name": class_map.get("version"),
        "sha256": hash_classes(classes) if named else None,
        "classes": classes,
    }
    said["sources"] = [
        {
            **source,
            "class_map": {key: class_map.get(key) for key in ("version", "sha256")},
            "options": {key: value for key, value in options.items() if key != "scenes_per_shard"},
            "terms": None if terms is None else asdict(terms),
        }
    ]
    if isinstance(said.get("pairs"), dict):
        said["pairs"] = {**said["pairs"], "masks": 1}
    said["scenes_per_shard"] = options.get("scenes_per_shard")
    return said


def convert_table(
    table: pa.Table, name: str, *, class_map: str, read_sizes: Callable[[], pa.Table]
) -> pa.Table:
    """Convert a table of version 1 to the columns of version 2.

    Args:
        table: all its columns.
        name: `scenes`, `rooms`, `objects` or `edges`; others are as they were.
        class_map: that the dataset was made with.
        read_sizes: returns `scene_id` and `num_rooms` of the scenes of the table.
    """
    if name == "scenes":
        return _add(table, SCENES, class_map=[class_map] * len(table))
    if name == "rooms":
        areas = [
            None if outline is None else measure_area(list(pairwise(outline))[::2])
            for outline in table["footprint"].to_pylist()
        ]
        labels = [label_of(LAYOUTS, said) for said in table["source_label"].to_pylist()]
        return _add(table.drop_columns(["label"]), ROOMS, label=labels, floor_area=areas)
    if name == "objects":
        return _add(table, OBJECTS, role=_tell_roles(table, _find_map(class_map)))
    if name == "edges":
        return _add(table, EDGES, **_name_ends(table, read_sizes()))
    return table


def _add(table: pa.Table, schema: pa.Schema, **columns: Any) -> pa.Table:
    """Return a table under a schema, with further columns; what is not given is null."""
    arrays = []
    for field in schema:
        if field.name in columns:
            arrays.append(pa.chunked_array([pa.array(columns[field.name], field.type)]))
        elif field.name in table.column_names:
            arrays.append(table[field.name])
        else:
            arrays.append(pa.chunked_array([pa.nulls(len(table), field.type)]))
    return pa.Table.from_arrays(arrays, schema=schema)


def _find_map(version: str) -> ClassMap | None:
    try:
        return load_class_map(version) if version in published_maps() else None
    except ClassMapError:
        return None


def _tell_roles(table: pa.Table, class_map: ClassMap | None) -> pa.Array:
    """Return the role of every object; what is structure is known of a published map alone."""
    columns = ["raw_category", "category", "class_index"]
    kinds = table.select(columns).group_by(columns, use_threads=False).aggregate([])
    roles: dict[tuple[Any, ...], Role] = {}
    for raw, category, class_index in zip(
        *(kinds[name].to_pylist() for name in columns), strict=True
    ):
        roles[raw, category, class_index] = _tell_role(raw, category, class_index, class_map)
    rows = zip(*(table[name].to_pylist() for name in columns), strict=True)
    return pa.array([roles[row] for row in rows], pa.string())


def _tell_role(
    raw: str, category: str | None, class_index: int | None, class_map: ClassMap | None
) -> Role:
    if class_index is not None:
        return "classified"
    if category is None:
        return "unmapped"
    if is_nameless(category):
        return "nameless"
    known = class_map.classify(raw) if class_map is not None else None
    return "structure" if known is not None and known.role == "structure" else "left-out"


def _name_ends(table: pa.Table, sizes: pa.Table) -> dict[str, Any]:
    """Return kind and index of both ends of edges between node indices."""
    rooms = dict(zip(sizes["scene_id"].to_pylist(), sizes["num_rooms"].to_pylist(), strict=True))
    encoded = table["scene_id"].combine_chunks().dictionary_encode()
    # An edge of a scene that is not there ends in an object, whatever its number.
    limits = np.array([rooms.get(scene, 0) for scene in encoded.dictionary.to_pylist()], np.int64)
    limit = limits[encoded.indices.to_numpy()] if len(table) else np.zeros(0, np.int64)
    ends: dict[str, Any] = {}
    for end in ("source", "target"):
        node = pc.cast(table[end], pa.int64()).to_numpy()
        kinds = np.where(node > limit, "object", np.where(node > 0, "room", "building"))
        ends[f"{end}_kind"] = kinds.tolist()
        ends[f"{end}_index"] = np.where(node > limit, node - limit, node).astype(np.int32)
    return ends
