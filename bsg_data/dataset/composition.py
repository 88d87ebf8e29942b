"""What each source gives to a dataset: buildings, rooms, and objects by role."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pandas as pd

from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_table
from bsg_data.scene.class_map import Role


def count_sources(dataset: Path, *, manifest: Manifest | None = None) -> pd.DataFrame:
    """Return one row a source, most buildings first.

    Columns: `source`, `buildings`, `rooms`, `objects`; the objects of each role (`classified`,
    `left-out`, `structure`, `nameless`, `unmapped`), which add up to `objects`; `classes`, how many
    of the classes occur; `share`, the share of the objects that are not structure which have a
    class; `placed`, the buildings with geometry; `connections`, the pairs of adjacent rooms.
    """
    manifest = manifest or read_manifest(dataset)
    columns = ["scene_id", "source", "num_rooms", "num_objects", "has_geometry"]
    scenes = read_table(dataset, "scenes", columns=columns, manifest=manifest).to_pandas()
    source_of = scenes.set_index("scene_id")["source"]
    objects = read_table(
        dataset, "objects", columns=["scene_id", "role", "class_index"], manifest=manifest
    ).to_pandas()
    objects["source"] = objects["scene_id"].map(source_of)
    edges = read_table(
        dataset, "edges", columns=["scene_id", "kind"], manifest=manifest
    ).to_pandas()
    adjacent = edges.loc[edges["kind"] == "adjacent", "scene_id"].map(source_of)
    grouped = scenes.groupby("source")
    roles = pd.crosstab(objects["source"], objects["role"])
    frame = pd.DataFrame(
        {
            "buildings": grouped.size(),
            "rooms": grouped["num_rooms"].sum(),
            "objects": grouped["num_objects"].sum(),
            **{
                role: roles[role] if role in roles else pd.Series(dtype="int64")
                for role in get_args(Role)
            },
            "classes": objects.groupby("source")["class_index"].nunique(),
            "placed": grouped["has_geometry"].sum(),
            "connections": adjacent.value_counts(),
        }
    )
    frame = frame.fillna(0).astype("int64")
    things = (frame["objects"] - frame["structure"]).clip(lower=1)
    frame["share"] = frame["classified"] / things
    frame = frame.rename_axis("source").reset_index()
    return frame.sort_values(["buildings", "source"], ascending=[False, True], ignore_index=True)
