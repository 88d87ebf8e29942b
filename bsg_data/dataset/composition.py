"""Count the buildings, rooms and objects of each source of a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import pandas as pd

from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import stream_table
from bsg_data.files import AnyPath
from bsg_data.scene.class_map import Role

_COLUMNS = {
    "scenes": ["scene_id", "source", "num_rooms", "num_objects", "has_geometry"],
    "objects": ["scene_id", "role", "class_index"],
    "edges": ["scene_id", "kind"],
}
_SHOWN = (
    *("buildings", "rooms", "objects", *get_args(Role)),
    *("classes", "placed", "connections", "share"),
)


def count_sources(dataset: AnyPath, *, manifest: Manifest | None = None) -> pd.DataFrame:
    """Return one row per source, most buildings first.

    Columns:

    - `source`, `buildings`, `rooms`, `objects`
    - the objects of each role (`classified`, `left-out`, `structure`, `nameless`, `unmapped`),
      which add up to `objects`
    - `classes`: number of classes that occur
    - `share`: objects with a class, divided by all objects that are not structure
    - `placed`: buildings with geometry
    - `connections`: pairs of adjacent rooms
    """
    dataset = Path(dataset)
    manifest = manifest or read_manifest(dataset)
    streams = (
        stream_table(dataset, name, columns=columns, manifest=manifest)
        for name, columns in _COLUMNS.items()
    )
    frame, held = pd.DataFrame(), pd.DataFrame()
    for tables in zip(*streams, strict=True):
        counts, kinds = _count_part(*(table.to_pandas(use_threads=False) for table in tables))
        frame = frame.add(counts, fill_value=0)
        held = pd.concat([held, kinds]).drop_duplicates()
    frame = frame.fillna(0).astype("int64")
    frame["classes"] = held.groupby("source").size().reindex(frame.index, fill_value=0)
    things = (frame["objects"] - frame["structure"]).clip(lower=1)
    frame["share"] = frame["classified"] / things
    frame = frame.rename_axis("source").reset_index()[["source", *_SHOWN]]
    return frame.sort_values(["buildings", "source"], ascending=[False, True], ignore_index=True)


def _count_part(
    scenes: pd.DataFrame, objects: pd.DataFrame, edges: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return one row per source of a part, and the classes that occur in each source."""
    source_of = scenes.set_index("scene_id")["source"]
    objects["source"] = objects["scene_id"].map(source_of)
    adjacent = edges.loc[edges["kind"] == "adjacent", "scene_id"].map(source_of)
    grouped = scenes.groupby("source")
    roles = pd.crosstab(objects["source"], objects["role"]).reindex(columns=list(get_args(Role)))
    counts = pd.DataFrame(
        {
            "buildings": grouped.size(),
            "rooms": grouped["num_rooms"].sum(),
            "objects": grouped["num_objects"].sum(),
            **roles,
            "placed": grouped["has_geometry"].sum(),
            "connections": adjacent.value_counts(),
        }
    )
    kinds = objects.loc[objects["class_index"].notna(), ["source", "class_index"]]
    return counts.fillna(0), kinds.drop_duplicates()
