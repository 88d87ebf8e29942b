"""Count the objects of a dataset by class, by role and by source, and plot the classes.

All counts are added up part by part, so memory holds one part of a table at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pandas as pd
import pyarrow.compute as pc

from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import read_table, stream_table
from bsg_data.errors import BSGError, ask_to_install
from bsg_data.files import PLAIN_TEXT, AnyPath, write_figure
from bsg_data.results import refuse_file
from bsg_data.scene.class_map import ClassMap, Role

_ROLES = list(get_args(Role))
_MARK = "belief-scene-graphs: frequencies"  # in the figure: marks it as written by this program
_HEAD = 4096  # bytes in which the mark is, in PNG and SVG


def _stream_objects(
    dataset: AnyPath, columns: list[str], class_map: ClassMap | None
) -> Iterator[pd.DataFrame]:
    """Yield the objects part by part; with a map, `columns` are what it says of their names."""
    read = ["scene_id", "room_index", *(columns if class_map is None else ["raw_category"])]
    for table in stream_table(Path(dataset), "objects", columns=read):
        objects = table.to_pandas(use_threads=False)
        if class_map is not None:
            names = objects["raw_category"]
            known = {name: class_map.classify(name) for name in names.unique()}
            for column in columns:
                objects[column] = names.map({n: getattr(k, column) for n, k in known.items()})
        yield objects


def count_classes(dataset: AnyPath, class_map: ClassMap | None = None) -> pd.DataFrame:
    """Return one row per class, in the order of its class space.

    Columns: `class`; `instances`; `rooms` and `buildings` with at least one instance; `doubles`,
    the rooms with two or more.

    Args:
        dataset: folder of the dataset.
        class_map: map to look up every object in; None: the classes that the dataset stores.
    """
    classes = (class_map or read_manifest(dataset).class_space).classes
    counts = [
        _count_part(objects) for objects in _stream_objects(dataset, ["class_index"], class_map)
    ]
    total = pd.concat(counts).groupby(level=0).sum()
    total = total.reindex(range(len(classes)), fill_value=0).astype("int64")
    total.insert(0, "class", classes)
    return total


def _count_part(objects: pd.DataFrame) -> pd.DataFrame:
    objects = objects[objects["class_index"].notna()]
    in_rooms = objects[objects["room_index"] > 0]
    rooms = in_rooms.groupby(["class_index", "scene_id", "room_index"]).size()
    by_class = objects.groupby("class_index")["scene_id"]
    counts = {
        "instances": by_class.size(),
        "rooms": rooms.groupby("class_index").size(),
        "buildings": by_class.nunique(),
        "doubles": (rooms >= 2).groupby("class_index").sum(),
    }
    return pd.DataFrame(counts).fillna(0)


def count_frequencies(dataset: AnyPath) -> pd.DataFrame:
    """Return one row per class, most frequent first.

    Columns: `class`; `instances`; `rooms` and `scenes` with at least one instance.
    """
    frame = count_classes(dataset).rename(columns={"buildings": "scenes"}).drop(columns="doubles")
    return frame.sort_values(["instances", "class"], ascending=[False, True], ignore_index=True)


def measure_coverage(
    dataset: AnyPath, class_map: ClassMap | None = None, *, most: int = 20
) -> dict[str, Any]:
    """Measure how much of a dataset a class map covers.

    Args:
        dataset: folder of the dataset.
        class_map: map to look up every object in; None: the maps that the dataset was built with,
            one for each source.
        most: number of left-out names to list.

    Returns:
        - `objects`: number of all objects, the sum of the next five
        - `classified`: objects with a class
        - `structure`: parts of the building: wall, floor, door, ...
        - `nameless`: objects named blank, `unknown` or `unknown/...`
        - `unmapped`: objects whose name is not in the map
        - `left_out`: named objects outside the classes
        - `share`: objects with a class, divided by all that are not structure
        - `share_of_named`: as `share`, but without the nameless objects
        - `most_left_out`: category → objects of the most frequent left-out names
    """
    parts = _stream_objects(dataset, ["role", "category"], class_map)
    counts = pd.concat([part.groupby(["role", "category"], dropna=False).size() for part in parts])
    counts = counts.groupby(level=[0, 1], dropna=False).sum()
    roles = counts.groupby(level=0).sum().reindex(_ROLES, fill_value=0)
    number = {role.replace("-", "_"): int(roles[role]) for role in _ROLES}
    order = ("classified", "structure", "nameless", "unmapped", "left_out")
    things = sum(number.values()) - number["structure"]
    left_out = counts[counts.index.get_level_values(0) == "left-out"].droplevel(0)
    left_out = left_out.sort_index().sort_values(ascending=False, kind="stable")
    return {
        "objects": sum(number.values()),
        **{role: number[role] for role in order},
        "share": number["classified"] / max(1, things),
        "share_of_named": number["classified"] / max(1, things - number["nameless"]),
        "most_left_out": left_out[:most].to_dict(),
    }


def count_sources(dataset: AnyPath, *, manifest: Manifest | None = None) -> pd.DataFrame:
    """Return one row per source, most buildings first.

    Columns:

    - `source`, `buildings`, `rooms`, `objects`
    - the objects of each role (`classified`, `left-out`, `structure`, `nameless`, `unmapped`),
      which add up to `objects`
    - `classes`: number of classes that occur
    - `placed`: buildings with geometry
    - `connections`: pairs of adjacent rooms
    - `share`: objects with a class, divided by all objects that are not structure
    """
    dataset = Path(dataset)
    manifest = manifest or read_manifest(dataset)
    columns = ["scene_id", "source", "num_rooms", "num_objects", "has_geometry"]
    scenes = read_table(dataset, "scenes", columns=columns, manifest=manifest)
    scenes = scenes.to_pandas(use_threads=False)
    source_of = scenes.set_index("scene_id")["source"]
    frame = scenes.groupby("source").agg(
        buildings=("scene_id", "size"),
        rooms=("num_rooms", "sum"),
        objects=("num_objects", "sum"),
        placed=("has_geometry", "sum"),
    )
    kinds = pd.concat(
        objects.groupby([objects["scene_id"].map(source_of), "role", "class_index"], dropna=False)
        .size()
        .rename_axis(["source", "role", "class_index"])
        for objects in _stream_objects(dataset, ["role", "class_index"], None)
    )
    roles = kinds.groupby(["source", "role"]).sum().unstack(fill_value=0)
    frame = frame.join(roles.reindex(columns=_ROLES, fill_value=0))
    frame["classes"] = kinds.reset_index().groupby("source")["class_index"].nunique()
    adjacent = (
        table.filter(pc.equal(table["kind"], "adjacent"))["scene_id"].to_pandas()
        for table in stream_table(dataset, "edges", columns=["scene_id", "kind"], manifest=manifest)
    )
    frame["connections"] = pd.concat(adjacent).map(source_of).value_counts()
    frame = frame.fillna(0).astype("int64")
    frame["share"] = frame["classified"] / (frame["objects"] - frame["structure"]).clip(lower=1)
    order = ["source", "buildings", "rooms", "objects", *_ROLES]
    shown: pd.DataFrame = frame.reset_index()[[*order, "classes", "placed", "connections", "share"]]
    return shown.sort_values(["buildings", "source"], ascending=[False, True], ignore_index=True)


def refuse_figure(path: AnyPath, *, force: bool) -> None:
    """Refuse a path for a figure that is in a dataset, in sealed results, or holds something else.

    Args:
        path: path of the figure.
        force: allow replacing a file that this program did not write.
    """
    path = Path(path)
    if path.is_dir():
        raise BSGError(f"{path}: is a folder; name a file in it, e.g. {path / 'classes.png'}")
    refuse_file(path, force=True)
    if path.exists() and not force:
        with path.open("rb") as file:
            if _MARK.encode() not in file.read(_HEAD):
                raise BSGError(
                    f"{path}: exists and is no figure of this program; --force replaces it"
                )


def plot_frequencies(frame: pd.DataFrame, path: AnyPath, *, title: str) -> None:
    """Plot the instances and the rooms of every class as bars, into an image file.

    Raises:
        BSGError: if matplotlib is not installed or the file cannot be written.
    """
    path = Path(path)
    try:
        from matplotlib import rc_context
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise BSGError(f"a figure needs matplotlib: {ask_to_install('figures')}") from error
    with rc_context(PLAIN_TEXT):
        figure = Figure(figsize=(9, 0.22 * len(frame) + 1.2), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, column, colour in ((left, "instances", "#FF8000"), (right, "rooms", "#9702FA")):
            bars = axes.barh(frame["class"], frame[column], color=colour, height=0.75)
            axes.bar_label(bars, fontsize=7, padding=2)
            axes.set_xlabel(column)
            axes.margins(x=0.12, y=0.01)
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelsize=8)
        left.invert_yaxis()
        figure.suptitle(title, fontsize=10)
        write_figure(figure, path, dpi=150, metadata={"Creator": _MARK})
