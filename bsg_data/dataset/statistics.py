"""Count the classes and sources of a dataset, what a class map covers of it, and plot it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.shards import stream_table
from bsg_data.errors import BSGError, ask_to_install
from bsg_data.figure_file import PLAIN_TEXT, write_figure
from bsg_data.files import AnyPath
from bsg_data.results import refuse_file
from bsg_data.scene.class_map import ClassMap, Role

_MARK = "belief-scene-graphs: frequencies"  # in the figure: marks it as written by this program
_HEAD = 4096  # bytes in which the mark is, in PNG and SVG


def count_frequencies(dataset: AnyPath) -> pd.DataFrame:
    """Return one row per class, most frequent first.

    Columns: `class`; `instances`; `rooms` and `scenes` with at least one instance.
    """
    data = Dataset.open(dataset)
    classes = data.manifest.class_space.classes
    totals = np.zeros((3, len(classes)), dtype=np.int64)
    for part in data.parts():
        cells, starts = part.every_cell, part.starts
        in_room = np.ones(len(cells), dtype=bool)
        in_room[starts[:-1]] = False
        there = np.add.reduceat(cells, starts[:-1]) > 0 if len(cells) else cells > 0
        totals += [cells.sum(axis=0), (cells[in_room] > 0).sum(axis=0), there.sum(axis=0)]
    frame = pd.DataFrame(
        {
            "class": classes,
            **dict(zip(("instances", "rooms", "scenes"), totals, strict=True)),
        }
    )
    return frame.sort_values(["instances", "class"], ascending=[False, True], ignore_index=True)


def refuse_figure(path: AnyPath, *, force: bool) -> None:
    """Refuse a path for a figure that is in a dataset, in sealed results, or holds something else.

    Args:
        path: path of the figure.
        force: allow replacing a file that this program did not write.

    Raises:
        BSGError: if the path is a folder, in a dataset, one of the files of sealed results, or,
            without `force`, another file.
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


@dataclass(frozen=True, slots=True)
class Coverage:
    """The objects of a dataset, counted by the roles that a class map gives them.

    Attributes:
        objects: number of all objects, the sum of the next five.
        classified: objects with a class.
        structure: parts of the building: wall, floor, door, ...
        nameless: objects named blank, `unknown` or `unknown/...`.
        unmapped: objects whose name is not in the map.
        left_out: named objects outside the classes.
        most_left_out: (category, instances) of the most frequent left-out names.
    """

    objects: int
    classified: int
    structure: int
    nameless: int
    unmapped: int
    left_out: int
    most_left_out: tuple[tuple[str, int], ...]

    @property
    def share(self) -> float:
        """Objects with a class, divided by all objects that are not structure; 0 without any."""
        return self.classified / max(1, self.objects - self.structure)

    @property
    def share_of_named(self) -> float:
        """As `share`, but without the nameless objects."""
        return self.classified / max(1, self.objects - self.structure - self.nameless)


def measure_coverage(
    dataset: AnyPath, class_map: ClassMap | None = None, *, most: int = 20
) -> Coverage:
    """Measure how much of a dataset a class map covers.

    Args:
        dataset: folder of the dataset.
        class_map: map to look up every object in; None: the maps that the dataset was built with,
            one for each source.
        most: number of left-out names to list.
    """
    dataset = Path(dataset)
    roles: Counter[str] = Counter()
    left_out: Counter[str] = Counter()
    for (raw, category, role), count in _count_names(dataset).items():
        known = None if class_map is None else class_map.classify(raw)
        found, name = (role, category) if known is None else (known.role, known.category)
        roles[found] += count
        if found == "left-out":
            left_out[str(name)] += count
    ranked = sorted(left_out.items(), key=lambda item: (-item[1], item[0]))
    return Coverage(
        objects=sum(roles.values()),
        **{role.replace("-", "_"): roles[role] for role in get_args(Role)},
        most_left_out=tuple(ranked[:most]),
    )


def _count_names(dataset: Path) -> Counter[tuple[str, str | None, str]]:
    """Count the objects of a dataset by raw name, category and role, file by file."""
    columns = ["raw_category", "category", "role"]
    counts: Counter[tuple[str, str | None, str]] = Counter()
    for objects in stream_table(dataset, "objects", columns=columns):
        kinds = objects.group_by(columns, use_threads=False).aggregate([([], "count_all")])
        rows = zip(*(kinds[name].to_pylist() for name in columns), strict=True)
        counts.update(dict(zip(rows, kinds["count_all"].to_pylist(), strict=True)))
    return counts


def count_classes(dataset: AnyPath, class_map: ClassMap) -> pd.DataFrame:
    """Return one row per class of a class map, in the order of its class space.

    Every object of the dataset is looked up again in this map. Columns: `class`; `instances`;
    `rooms` and `buildings` with at least one instance; `doubles`, the rooms with two or more.
    """
    dataset = Path(dataset)
    columns = ["scene_id", "room_index", "raw_category"]
    totals = np.zeros((4, len(class_map.classes)), dtype=np.int64)
    index: dict[str, int | None] = {}
    for table in stream_table(dataset, "objects", columns=columns):
        objects = table.to_pandas(use_threads=False)
        for name in objects["raw_category"].unique():
            index.setdefault(name, class_map.classify(name).class_index)
        totals += _count_objects(objects.assign(kind=objects["raw_category"].map(index)), totals)
    counted = dict(zip(("instances", "rooms", "buildings", "doubles"), totals, strict=True))
    return pd.DataFrame({"class": class_map.classes, **counted})


def _count_objects(objects: pd.DataFrame, like: Counts) -> Counts:
    """Return instances, rooms, buildings and doubles of every class in some buildings, `[4, C]`."""
    objects = objects[objects["kind"].notna()]
    in_rooms = objects[objects["room_index"] > 0]
    each = in_rooms.groupby(["kind", "scene_id", "room_index"]).size()
    counts = (
        objects.groupby("kind").size(),
        each.groupby("kind").size(),
        objects.groupby("kind")["scene_id"].nunique(),
        (each >= 2).groupby("kind").sum(),
    )
    classes = range(like.shape[1])
    return np.stack([one.reindex(classes).fillna(0).astype(np.int64) for one in counts])


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
