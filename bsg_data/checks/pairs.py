"""Check that splits do not leak and that pairs follow from the objects and their recipe."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
import pyarrow as pa

from bsg_data.arrays import Counts
from bsg_data.checks.faults import Fault
from bsg_data.dataset.histograms import count_cells, to_histograms
from bsg_data.dataset.manifest import FileEntry, Manifest
from bsg_data.dataset.splits import assign_splits
from bsg_data.errors import RecipeError
from bsg_data.observation.masks_v1 import sample_hidden_of_format_1, sample_visited_of_format_1
from bsg_data.observation.pairs import (
    histogram_column,
    read_views,
    sample_pairs,
    split_of_file,
    tells_view,
)
from bsg_data.observation.view import View
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.scene.connections import Connections
from bsg_data.scene.scene_id import building_hash


def check_splits(
    splits: pd.DataFrame, scenes: pd.DataFrame, recipe: SplitRecipe
) -> Iterator[Fault]:
    """Check that every building is in exactly one split, the one that the recipe says."""
    twice = splits["scene_id"][splits["scene_id"].duplicated()]
    for scene in twice:
        yield Fault("splits", f"{scene} is in two splits or twice in one")
    for scene in sorted(set(splits["scene_id"]) ^ set(scenes["scene_id"])):
        yield Fault("splits", f"{scene} is not in both scenes and splits")
    spread = splits.groupby(splits["scene_id"].map(building_hash))["split"].nunique()
    for building in spread.index[spread > 1]:
        yield Fault("splits", f"building {building} leaks: it is in more than one split")
    own = scenes["source_split"].where(scenes["source_split"].notna(), None)
    try:
        by_recipe = assign_splits(
            dict(zip(scenes["scene_id"], own, strict=True)),
            recipe,
            sources=dict(zip(scenes["scene_id"], scenes["source"], strict=True)),
        )
    except RecipeError as error:
        yield Fault("splits", f"cannot be made by the recipe: {error}")
        return
    for scene, split in zip(splits["scene_id"], splits["split"], strict=True):
        if scene in by_recipe and by_recipe[scene] != split:
            yield Fault(
                "splits", f"{scene} is in {split}, by the recipe it is in {by_recipe[scene]}"
            )


class PairTruth:
    """What the pairs must be, from the other tables and the recipes alone."""

    def __init__(
        self, frames: dict[str, pd.DataFrame], splits: pd.DataFrame, manifest: Manifest
    ) -> None:
        self.cells = count_frames(frames, width=len(manifest.class_space.classes))
        self.split = dict(zip(splits["scene_id"], splits["split"], strict=True))
        self.recipe = manifest.pairs
        edges = frames["edges"][frames["edges"]["kind"] == "adjacent"]
        self.adjacency: dict[str, list[tuple[int, int]]] = {}
        for scene, a, b in zip(
            edges["scene_id"], edges["source_index"], edges["target_index"], strict=True
        ):
            self.adjacency.setdefault(scene, []).append((int(a), int(b)))

    def check(self, entry: FileEntry, table: pa.Table) -> Iterator[Fault]:
        """Check one file of pairs."""
        if self.recipe is None:
            return
        own = split_of_file(entry.path)
        scenes = table["scene_id"].to_pandas()
        for scene, rows in scenes.groupby(scenes, sort=False).indices.items():
            name = str(scene)
            where = f"{entry.path}, {name}"
            if self.split.get(name) != own:
                yield Fault(where, f"is of split {self.split.get(name)}, not {own}")
            elif (np.diff(rows) != 1).any():
                yield Fault(where, "its rows do not stand together")
            else:
                yield from self._check_scene(where, name, table.slice(rows[0], len(rows)))

    def _check_scene(self, where: str, scene: str, table: pa.Table) -> Iterator[Fault]:
        cells, recipe = self.cells[scene], self.recipe
        if recipe is None:
            return
        shape = (recipe.draws, *cells.shape)
        expected = f"expected draws 0..{shape[0] - 1} of nodes 0..{shape[1] - 1}, in order"
        if len(table) != shape[0] * shape[1]:
            yield Fault(where, f"{expected}: {shape[0] * shape[1]} rows, found {len(table)}")
            return
        draws, nodes = np.divmod(np.arange(len(table)), shape[1])
        numbers = (table["draw"].to_numpy(), table["node_index"].to_numpy())
        if (numbers[0] != draws).any() or (numbers[1] != nodes).any():
            yield Fault(where, expected)
            return
        inputs = histogram_column(table, "input").astype(np.int64).reshape(shape)
        targets = histogram_column(table, "target").reshape(shape)
        view = read_views(table, recipe)
        faults = list(_check_histograms(where, inputs, targets, cells))
        if tells_view(table):
            faults += _check_view(where, view, inputs, targets)
        yield from faults
        if not faults:
            known = Connections.of_pairs(self.adjacency.get(scene, ()))
            if not _is_drawn(view, inputs, cells, recipe, scene, known):
                yield Fault(where, "is not the mask of its recipe (or another NumPy drew it)")


def _is_drawn(
    view: View,
    inputs: Counts,
    cells: Counts,
    recipe: PairsRecipe,
    scene: str,
    connections: Connections,
) -> bool:
    """Say whether pairs `[D, N, C]` and the views of their rows are those of the recipe."""
    if recipe.masks != 1:
        views, drawn = sample_pairs(cells, recipe, scene_id=scene, connections=connections)
        nodes = len(cells)
        same = all(
            one.agrees(view.take(draw * nodes, (draw + 1) * nodes))
            for draw, one in enumerate(views)
        )
        return same and np.array_equal(drawn, inputs)
    for draw, (left, rows) in enumerate(
        zip(inputs, view.visited.reshape(len(inputs), -1), strict=True)
    ):
        visited = sample_visited_of_format_1(
            cells, recipe.mask, scene_id=scene, draw=draw, connections=connections
        )
        hidden = sample_hidden_of_format_1(cells, visited, recipe.mask, scene_id=scene, draw=draw)
        if (visited != rows).any() or (to_histograms(cells - hidden) != left).any():
            return False
    return True


def _check_view(where: str, view: View, inputs: Counts, targets: Counts) -> Iterator[Fault]:
    """Check that what was seen can be seen under what is told."""
    share, withheld = view.hidden_share, view.withheld.copy()
    withheld[:: inputs.shape[1]] = False  # a building shows what its searched rooms do
    seen, there = (counts.reshape(len(share), -1) for counts in (inputs, targets))
    if not ((share >= 0) & (share <= 1)).all():
        yield Fault(where, "hidden_share is not from 0 to 1")
    elif (seen[withheld] > 0).any():
        yield Fault(where, "shows objects of a class that is withheld")
    elif (seen[share == 1] > 0).any():
        yield Fault(where, "shows objects where hidden_share is 1")
    elif ((share == 0)[:, None] & ~withheld & (seen < there)).any():
        yield Fault(where, "hides objects where hidden_share is 0")


def _check_histograms(
    where: str, inputs: Counts, targets: Counts, cells: Counts
) -> Iterator[Fault]:
    if (targets != to_histograms(cells)).any():
        yield Fault(where, "target is not the histogram of the objects table")
    if (inputs > targets).any():
        yield Fault(where, "input is above target: a mask would have added objects")
    null_region = inputs[:, 0] - inputs[:, 1:].sum(axis=1)
    if (null_region < 0).any() or (null_region > cells[0]).any():
        yield Fault(where, "the building's input is not the sum of its rooms and the null region")


def count_frames(frames: dict[str, pd.DataFrame], *, width: int) -> dict[str, Counts]:
    """Count the cells `[1 + R, C]` of every scene, from the tables alone."""
    objects, scenes = frames["objects"], frames["scenes"]
    classified = objects[objects["class_index"].notna()]
    rows_of = classified.groupby("scene_id").indices
    rooms = classified["room_index"].to_numpy(np.int64)
    classes = classified["class_index"].to_numpy(np.int64)
    nobody = np.zeros(0, dtype=np.int64)
    return {
        scene: count_cells(
            rooms[rows_of.get(scene, nobody)],
            classes[rows_of.get(scene, nobody)],
            shape=(size + 1, width),
        )
        for scene, size in zip(scenes["scene_id"], scenes["num_rooms"].tolist(), strict=True)
    }


def check_every_scene_has_pairs(held: Sequence[str], splits: pd.DataFrame) -> Iterator[Fault]:
    """Check that every scene that is split has pairs, in one file."""
    for scene in sorted(set(splits["scene_id"]) - set(held)):
        yield Fault("pairs", f"{scene} has none")
    for scene in sorted(scene for scene, files in Counter(held).items() if files > 1):
        yield Fault("pairs", f"{scene} is in two files")
