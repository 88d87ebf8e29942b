"""Check that scenes, rooms, objects and edges agree with each other and with the class map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import get_args

import numpy as np
import numpy.typing as npt
import pandas as pd
import pyarrow as pa

from bsg_data.checks.faults import Fault
from bsg_data.dataset.manifest import MANIFEST, ClassSpaceEntry, Manifest
from bsg_data.scene.class_map import Role, load_class_map, published_maps
from bsg_data.scene.scene_graph import ADJACENCY_METHODS, is_scene_id
from bsg_data.scene.scene_id import building_hash

_PLACES = ("centroid", "box_min", "box_max", "part_min", "part_max")
_WHOLES = (("centroid",), ("box_min", "box_max"), ("part_min", "part_max"))  # all or nothing
_ROUNDING = 2e-4  # metres: coordinates are rounded, and what is derived from them again


def check_parts(tables: dict[str, list[pa.Table]]) -> Iterator[Fault]:
    """Check that part k of every table holds the same scenes, rows together and in order."""
    for number, scenes in enumerate(tables["scenes"]):
        order = {scene: i for i, scene in enumerate(scenes["scene_id"].to_pylist())}
        for name, parts in tables.items():
            if name not in ("rooms", "objects", "edges"):
                continue
            places = [order.get(s, -1) for s in parts[number]["scene_id"].to_pylist()]
            if -1 in places or places != sorted(places):
                yield Fault(name, f"part {number} has rows of other scenes, or not in their order")


def check_scenes(frames: dict[str, pd.DataFrame], manifest: Manifest) -> Iterator[Fault]:
    """Check keys, orders and counts."""
    scenes, rooms, objects = frames["scenes"], frames["rooms"], frames["objects"]
    ids = scenes["scene_id"]
    if ids.duplicated().any():
        for scene in ids[ids.duplicated()]:
            yield Fault("scenes", f"{scene} is there twice")
        return  # nothing else can be told apart
    for scene in ids[~ids.map(is_scene_id)]:
        yield Fault("scenes", f"{scene!r} cannot be a scene id: it would lead out of a folder")
    if not ids.is_monotonic_increasing:
        yield Fault("scenes", "is not sorted by scene_id")
    kinds, listed = set(scenes["source"]), [source.kind for source in manifest.sources]
    for kind in sorted(kinds ^ set(listed)):
        yield Fault(MANIFEST, f"source {kind} is in the manifest or in the scenes, not in both")
    buildings = ids.map(building_hash)
    for building in buildings[buildings.duplicated()]:
        yield Fault("scenes", f"building {building} is there under two scene ids")
    for name, frame in (("rooms", rooms), ("objects", objects), ("edges", frames["edges"])):
        for scene in sorted(set(frame["scene_id"]) - set(ids)):
            yield Fault(name, f"{scene} is no scene of the dataset")
    classified = objects[objects["class_index"].notna()]
    for column, frame in (
        ("num_rooms", rooms),
        ("num_objects", objects),
        ("num_classified", classified),
    ):
        sizes = frame.groupby("scene_id").size().reindex(ids, fill_value=0)
        for scene, stated, counted in zip(ids, scenes[column], sizes, strict=True):
            if stated != counted:
                yield Fault("scenes", f"{scene}: {column} is {stated}, {counted} are there")
    totals = manifest.totals
    for what, stated, counted in (
        ("scenes", totals.scenes, len(scenes)),
        ("rooms", totals.rooms, len(rooms)),
        ("objects", totals.objects, len(objects)),
        ("classified", totals.classified, len(classified)),
        ("unmapped", totals.unmapped, int(objects["category"].isna().sum())),
        ("placed", totals.placed, int(scenes["has_geometry"].sum())),
        ("adjacent", totals.adjacent, int((frames["edges"]["kind"] == "adjacent").sum())),
    ):
        if stated != counted:
            yield Fault(MANIFEST, f"totals.{what} is {stated}, {counted} are there")
    together = rooms["scene_id"].eq(rooms["scene_id"].shift())
    rising = rooms["region_id"].diff() > 0
    for scene in rooms["scene_id"][(rooms["region_id"] < 0) | (together & ~rising)].unique():
        yield Fault("rooms", f"{scene}: region_id does not rise from 0 or more")
    for name, frame, key in (("rooms", rooms, "room_index"), ("objects", objects, "object_index")):
        expected = frame.groupby("scene_id").cumcount() + 1
        for scene in frame["scene_id"][frame[key] != expected].unique():
            yield Fault(name, f"{scene}: {key} does not run 1, 2, 3, …")


def check_objects(frames: dict[str, pd.DataFrame], manifest: Manifest) -> Iterator[Fault]:
    """Check that every object is in a room of its scene and in the class that the map says."""
    objects = frames["objects"]
    classes = manifest.class_space.classes
    rooms = frames["scenes"].set_index("scene_id")["num_rooms"]
    limit = objects["scene_id"].map(rooms).astype(float)
    outside = (objects["room_index"] < 0) | (objects["room_index"] > limit)
    yield from _each(objects, outside, "room_index is not 0..R")
    index = objects["class_index"]
    yield from _each(objects, index >= len(classes), f"class_index is not 0..{len(classes) - 1}")
    named = index.map(dict(enumerate(classes)))
    wrong = (named != objects["class"]) & ~(named.isna() & objects["class"].isna())
    yield from _each(objects, wrong, "class is not the name of class_index")
    yield from _check_boxes(objects)
    odd = objects["colour"].notna() & ~objects["colour"].fillna("").str.fullmatch("[0-9A-F]{6}")
    yield from _each(objects, odd, "colour is not RRGGBB")
    for column in ("instance_id", "object_index"):
        repeated = objects.duplicated(["scene_id", column])
        yield from _each(objects, repeated, f"{column} is there twice")
    yield from _check_roles(objects)
    yield from _check_names(objects, frames["scenes"], manifest.class_space)


def _check_roles(objects: pd.DataFrame) -> Iterator[Fault]:
    """Check that roles agree with classes and categories."""
    role = objects["role"]
    yield from _each(objects, ~role.isin(get_args(Role)), f"role is none of {get_args(Role)}")
    wrong = (role == "classified") != objects["class_index"].notna()
    yield from _each(objects, wrong, "role is classified with a class, and only then")
    wrong = (role == "unmapped") != objects["category"].isna()
    yield from _each(objects, wrong, "role is unmapped without a category, and only then")


def _check_names(
    objects: pd.DataFrame, scenes: pd.DataFrame, space: ClassSpaceEntry
) -> Iterator[Fault]:
    """Check that class and role are what the published class map of a scene says."""
    maps = objects["scene_id"].map(scenes.set_index("scene_id")["class_map"])
    for version in sorted(set(maps.dropna()) & set(published_maps())):
        published = load_class_map(version)
        if published.classes != space.classes:
            yield Fault("scenes", f"class map {version} does not lead into {space.name}")
            continue
        own = objects[maps == version]
        known = {name: published.classify(name) for name in own["raw_category"].unique()}
        index = own["class_index"].astype(float)
        by_map = own["raw_category"].map({k: v.class_index for k, v in known.items()}).astype(float)
        differs = (by_map != index) & ~(by_map.isna() & index.isna())
        yield from _each(own, differs, f"class_index is not what {version} says")
        role = own["raw_category"].map({k: v.role for k, v in known.items()})
        yield from _each(own, role != own["role"], f"role is not what {version} says")


def _check_boxes(objects: pd.DataFrame) -> Iterator[Fault]:
    """Check that places are whole and finite, and that centroid and part lie within the box."""
    there = objects["box_min_x"].notna()
    yield from _each(
        objects, there != objects["has_geometry"], "has_geometry is not what the box says"
    )
    names = [f"{what}_{axis}" for what in _PLACES for axis in "xyz"]
    infinite = np.isinf(objects[names].to_numpy(dtype=float)).any(axis=1)
    yield from _each(objects, pd.Series(infinite, objects.index), "its geometry is not finite")
    for what in _WHOLES:
        columns = [f"{name}_{axis}" for name in what for axis in "xyz"]
        partial = _is_partial(objects[columns])
        yield from _each(objects, partial, f"has only part of its {what[0].split('_')[0]}")
    bare = there & objects["centroid_x"].isna() | objects["part_min_x"].notna() & ~there
    yield from _each(objects, bare, "has a box without a centroid, or a part without a box")
    for axis in "xyz":
        low, high = objects[f"box_min_{axis}"], objects[f"box_max_{axis}"]
        outside = (low > high) | (objects[f"part_min_{axis}"] > objects[f"part_max_{axis}"])
        for inner in ("centroid", "part_min", "part_max"):
            value = objects[f"{inner}_{axis}"]
            outside |= (value < low - _ROUNDING) | (value > high + _ROUNDING)
        yield from _each(objects, outside, f"its centroid or its part is outside its box in {axis}")
    sound = objects["area"].isna() | ((objects["area"] > 0) & np.isfinite(objects["area"]))
    yield from _each(objects, ~sound, "area is not above 0")


def check_rooms(frames: dict[str, pd.DataFrame]) -> Iterator[Fault]:
    """Check boxes, footprints and storeys of rooms, and what the scenes say of geometry."""
    rooms, scenes = frames["rooms"], frames["scenes"]
    names = [f"{what}_{axis}" for what in _PLACES[:3] for axis in "xyz"]
    infinite = np.isinf(rooms[[*names, "floor_z", "floor_area"]].to_numpy(dtype=float)).any(axis=1)
    wrong = pd.Series(infinite, rooms.index)
    for what in _WHOLES[:2]:
        columns = [f"{name}_{axis}" for name in what for axis in "xyz"]
        wrong |= _is_partial(rooms[columns])
    there = rooms["box_min_x"].notna()
    wrong |= there & rooms["centroid_x"].isna()
    wrong |= ~_fill_boxes(rooms)
    wrong |= (rooms["floor_index"] < 0) | (rooms["floor_area"] <= 0)
    for axis in "xyz":
        low, high = rooms[f"box_min_{axis}"], rooms[f"box_max_{axis}"]
        wrong |= (low > high) | ((rooms[f"centroid_{axis}"] - (low + high) / 2).abs() > _ROUNDING)
    for row in rooms[wrong].itertuples():
        yield Fault("rooms", f"{row.scene_id}, room {row.room_index}: its geometry is impossible")
    placed = {
        *rooms.loc[rooms["centroid_x"].notna() | rooms["footprint"].notna(), "scene_id"],
        *frames["objects"].loc[frames["objects"]["centroid_x"].notna(), "scene_id"],
    }
    axes = ("x", "y", "z", "-x", "-y", "-z")
    for row in scenes[scenes["up_axis"].notna() & ~scenes["up_axis"].isin(axes)].itertuples():
        yield Fault("scenes", f"{row.scene_id}: up_axis is none of {', '.join(axes)}")
    for row in scenes[scenes["has_geometry"] != scenes["scene_id"].isin(placed)].itertuples():
        yield Fault("scenes", f"{row.scene_id}: has_geometry is not what rooms and objects say")


def _is_partial(columns: pd.DataFrame) -> pd.Series[bool]:
    """Say of every row whether some of its columns are null, and not all."""
    null = columns.isna().to_numpy()
    return pd.Series(null.any(axis=1) & ~null.all(axis=1), columns.index)


def _fill_boxes(rooms: pd.DataFrame) -> pd.Series[bool]:
    """Say of every room whether its footprint is a polygon that fills its box from above.

    A room without a box may have one, too; and a room with a box may have none.
    """
    names = ["box_min_x", "box_min_y", "box_max_x", "box_max_y"]
    boxes = rooms[names].to_numpy(dtype=float)
    filled = [
        footprint is None or _fills(footprint, box)
        for footprint, box in zip(rooms["footprint"], boxes, strict=True)
    ]
    return pd.Series(filled, rooms.index, dtype=bool)


def _fills(footprint: object, box: npt.NDArray[np.float64]) -> bool:
    if not isinstance(footprint, np.ndarray) or len(footprint) < 6 or len(footprint) % 2:
        return False
    corners = footprint.reshape(-1, 2)
    if not np.isfinite(corners).all():
        return False
    ends = [*corners.min(axis=0), *corners.max(axis=0)]
    return bool(np.isnan(box).all() or (np.abs(np.array(ends) - box) <= 10 * _ROUNDING).all())


def _each(objects: pd.DataFrame, wrong: pd.Series[bool], what: str) -> Iterator[Fault]:
    """Name the first objects at fault and count the rest."""
    rows = objects[wrong.fillna(False)]
    for row in rows.head(3).itertuples():
        yield Fault("objects", f"{row.scene_id}, object {row.object_index}: {what}")
    if len(rows) > 3:
        yield Fault("objects", f"… and {len(rows) - 3} more: {what}")


def check_edges(frames: dict[str, pd.DataFrame]) -> Iterator[Fault]:
    """Containment is exactly what rooms and objects say; adjacency joins two rooms, once."""
    edges = frames["edges"]
    rooms = frames["scenes"].set_index("scene_id")["num_rooms"]
    objects = frames["objects"]
    if edges.empty and objects.empty and frames["rooms"].empty:
        return  # pandas cannot merge what has no rows
    to_rooms = pd.DataFrame(
        {
            "scene_id": frames["rooms"]["scene_id"],
            "source_kind": "building",
            "source_index": 0,
            "target_kind": "room",
            "target_index": frames["rooms"]["room_index"],
        }
    )
    in_room = objects["room_index"] > 0
    to_objects = pd.DataFrame(
        {
            "scene_id": objects["scene_id"],
            "source_kind": np.where(in_room, "room", "building"),
            "source_index": objects["room_index"],
            "target_kind": "object",
            "target_index": objects["object_index"],
        }
    )
    expected = pd.concat([to_rooms, to_objects])
    ends = ["source_kind", "source_index", "target_kind", "target_index"]
    stored = edges.loc[edges["kind"] == "contains", ["scene_id", *ends]]
    both = expected.merge(stored, how="outer", indicator=True)
    for scene in both.loc[both["_merge"] != "both", "scene_id"].unique():
        yield Fault("edges", f"{scene}: contains edges are not what rooms and objects say")
    if stored.duplicated().any():
        yield Fault("edges", "a contains edge is there twice")
    adjacent = edges[edges["kind"] == "adjacent"]
    limit = adjacent["scene_id"].map(rooms).astype(float)
    first, second = adjacent["source_index"], adjacent["target_index"]
    wrong = ~((first >= 1) & (first < second) & (second <= limit))
    wrong |= (adjacent["source_kind"] != "room") | (adjacent["target_kind"] != "room")
    wrong |= adjacent.duplicated(["scene_id", "source_index", "target_index"])
    for scene in adjacent.loc[wrong, "scene_id"].unique():
        yield Fault("edges", f"{scene}: an adjacent edge does not join two rooms once, low to high")
    known = adjacent["method"].isin(ADJACENCY_METHODS)
    known &= _is_distance(adjacent, frames["rooms"])
    for scene in adjacent.loc[~known, "scene_id"].unique():
        yield Fault("edges", f"{scene}: an adjacent edge has an unknown method or distance")
    contains = edges[edges["kind"] == "contains"]
    odd = (contains["method"] != "annotation") | contains["distance_m"].notna()
    for scene in contains.loc[odd, "scene_id"].unique():
        yield Fault("edges", f"{scene}: a contains edge has another method, or a distance")
    for kind in sorted(set(edges["kind"]) - {"contains", "adjacent"}):
        yield Fault("edges", f"kind {kind!r} is neither contains nor adjacent")


def _is_distance(adjacent: pd.DataFrame, rooms: pd.DataFrame) -> pd.Series[bool]:
    """Say of every edge whether its distance is that of the centroids, or null without these."""
    axes = ["centroid_x", "centroid_y", "centroid_z"]
    places = rooms.set_index(["scene_id", "room_index"])[axes]
    ends = [
        places.reindex(pd.MultiIndex.from_frame(adjacent[["scene_id", end]])).to_numpy()
        for end in ("source_index", "target_index")
    ]
    expected = np.linalg.norm(ends[0] - ends[1], axis=1)
    stored = adjacent["distance_m"].to_numpy(dtype=float)
    return pd.Series(np.isclose(stored, expected, equal_nan=True), index=adjacent.index)


def check_meshes(manifest: Manifest, scenes: pd.DataFrame) -> Iterator[Fault]:
    """Check that what meshes cover adds up, and that they are of scenes with geometry."""
    placed = set(scenes.loc[scenes["up_axis"].notna(), "scene_id"])
    for scene in sorted(placed.symmetric_difference(manifest.meshes)):
        yield Fault(MANIFEST, f"{scene}: has a mesh in the manifest or an up_axis, not both")
    for scene, mesh in manifest.meshes.items():
        if mesh.texels != mesh.listed + mesh.snapped + mesh.black + mesh.unlisted:
            yield Fault(MANIFEST, f"{scene}: the texels of its mesh do not add up")
        parts = mesh.listed_area + mesh.unlisted_area + mesh.uncoloured_area
        if not abs(parts - mesh.area) < 0.01:
            yield Fault(MANIFEST, f"{scene}: the surface of its mesh does not add up")
