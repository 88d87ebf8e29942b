"""Count the objects of a dataset by class, by role and by source, and plot the classes.

All counts are added up file by file, so memory holds one file of a table at a time.
"""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.scenes import take_adjacent
from bsg_data.errors import BSGError, ask_to_install
from bsg_data.files import PLAIN_TEXT, AnyPath, write_figure
from bsg_data.scene.class_map import ClassMap, Role

Row = dict[str, Any]
_ROLES = list(get_args(Role))
_SHOWN = 20  # left-out names
_TITLE = 100  # characters of a line above the bars


def _stream_objects(
    data: Dataset, columns: list[str], class_map: ClassMap | None
) -> Iterator[pa.Table]:
    """Yield the objects file by file; with a map, `columns` are what it says of their names."""
    read = ["scene_id", "room_index", *(columns if class_map is None else ["raw_category"])]
    for table in data.stream_table("objects", columns=read):
        if class_map is not None:
            names = pc.dictionary_encode(table["raw_category"].combine_chunks())
            known = [class_map.classify(name) for name in names.dictionary.to_pylist()]
            for column in columns:
                values = pa.array([getattr(entry, column) for entry in known])
                table = table.append_column(column, values.take(names.indices))
        yield table


def _count(table: pa.Table, keys: list[str]) -> Iterator[tuple[Any, ...]]:
    """Yield each combination of values of some columns, and how many rows have it."""
    counts = table.select(keys).group_by(keys).aggregate([([], "count_all")])
    yield from zip(*(counts[key].to_pylist() for key in (*keys, "count_all")), strict=True)


def count_classes(data: Dataset) -> list[Row]:
    """Return one row per class, in the order of the class space.

    Each has its `class`; `instances`; `rooms` and `buildings` with at least one instance.
    """
    classes = data.manifest.class_space.classes
    total = np.zeros((3, len(classes)), dtype=np.int64)
    for objects in _stream_objects(data, ["class_index"], None):
        objects = objects.filter(pc.is_valid(objects["class_index"]))
        for index, _, room, number in _count(objects, ["class_index", "scene_id", "room_index"]):
            total[:, index] += (number, room > 0, 0)
        buildings = objects.group_by("class_index").aggregate([("scene_id", "count_distinct")])
        total[2, buildings["class_index"].to_numpy()] += buildings[-1].to_numpy()
    names = ("instances", "rooms", "buildings")
    return [
        {"class": name, **dict(zip(names, row, strict=True))}
        for name, row in zip(classes, total.T.tolist(), strict=True)
    ]


def measure_coverage(data: Dataset, class_map: ClassMap | None = None) -> dict[str, Any]:
    """Measure how much of a dataset a class map covers.

    Args:
        data: the dataset.
        class_map: map to look up every object in; None: the maps that the dataset was built with,
            one for each source.

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
    roles, left_out = Counter[str](), Counter[str]()
    for objects in _stream_objects(data, ["role", "category"], class_map):
        for role, category, times in _count(objects, ["role", "category"]):
            roles[role] += times
            if role == "left-out":
                left_out[category] += times
    number, things = roles.total(), roles.total() - roles["structure"]
    frequent = sorted(left_out.items(), key=lambda item: (-item[1], item[0]))[:_SHOWN]
    order = ("classified", "structure", "nameless", "unmapped", "left-out")
    return {
        "objects": number,
        **{role.replace("-", "_"): roles[role] for role in order},
        "share": roles["classified"] / max(1, things),
        "share_of_named": roles["classified"] / max(1, things - roles["nameless"]),
        "most_left_out": dict(frequent),
    }


def count_sources(data: Dataset) -> list[Row]:
    """Return one row per source, most buildings first.

    Each has:

    - `source`, `buildings`, `rooms`, `objects`
    - the objects of each role (`classified`, `left-out`, `structure`, `nameless`, `unmapped`),
      which add up to `objects`
    - `classes`: number of classes that occur
    - `placed`: buildings with geometry
    - `connections`: pairs of adjacent rooms
    - `share`: objects with a class, divided by all objects that are not structure
    """
    columns = ["scene_id", "source", "num_rooms", "num_objects", "has_geometry"]
    scenes = pa.concat_tables(data.stream_table("scenes", columns=columns))
    source_of: dict[str, str] = {}
    found: dict[str, Counter[str]] = {}
    for scene, source, rooms, number, placed in zip(*scenes.to_pydict().values(), strict=True):
        source_of[scene] = source
        row = found.setdefault(source, Counter())
        row.update(buildings=1, rooms=rooms, objects=number, placed=int(placed))
    classes = {source: set[int]() for source in found}
    for objects in _stream_objects(data, ["role", "class_index"], None):
        for scene, role, index, times in _count(objects, ["scene_id", "role", "class_index"]):
            found[source_of[scene]][role] += times
            classes[source_of[scene]] |= {index} - {None}
    for table in data.stream_table("edges", columns=["scene_id", "kind"]):
        for scene, times in _count(take_adjacent(table), ["scene_id"]):
            found[source_of[scene]]["connections"] += times
    rows = [
        {
            "source": source,
            **{name: row[name] for name in ("buildings", "rooms", "objects", *_ROLES)},
            "classes": len(classes[source]),
            **{name: row[name] for name in ("placed", "connections")},
            "share": row["classified"] / max(row["objects"] - row["structure"], 1),
        }
        for source, row in found.items()
    ]
    return sorted(rows, key=lambda row: (-row["buildings"], row["source"]))


def plot_frequencies(rows: Sequence[Mapping[str, Any]], path: AnyPath, *, title: str) -> None:
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
        figure = Figure(figsize=(9, 0.22 * len(rows) + 1.2), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True)
        names = [row["class"] for row in rows]
        for axes, column, colour in ((left, "instances", "#FF8000"), (right, "rooms", "#9702FA")):
            bars = axes.barh(names, [row[column] for row in rows], color=colour, height=0.75)
            axes.bar_label(bars, fontsize=7, padding=2)
            axes.set_xlabel(column)
            axes.margins(x=0.12, y=0.01)
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelsize=8)
        left.invert_yaxis()
        figure.suptitle(textwrap.fill(title, _TITLE), fontsize=10)
        write_figure(figure, path, dpi=150)
