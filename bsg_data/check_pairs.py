"""Check that splits do not leak and that pairs follow from the objects and their recipe."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pandas as pd
import pyarrow as pa

from bsg_data.faults import Fault
from bsg_data.histograms import Counts, count_cells, to_histograms
from bsg_data.manifest import FileEntry, Manifest
from bsg_data.masks import hidden_bounds
from bsg_data.pairs import histogram_column, split_of_file
from bsg_data.recipes import MaskRecipe
from bsg_data.sources import building_of


def check_splits(splits: pd.DataFrame, scenes: pd.DataFrame, manifest: Manifest) -> Iterator[Fault]:
    """Check that every building is in exactly one split of the recipe."""
    for scene in splits["scene_id"][splits["scene_id"].duplicated()]:
        yield Fault("splits", f"{scene} is in two splits or twice in one")
    for scene in sorted(set(splits["scene_id"]) ^ set(scenes["scene_id"])):
        yield Fault("splits", f"{scene} is not in both scenes and splits")
    spread = splits.groupby(splits["scene_id"].map(building_of))["split"].nunique()
    for building in spread.index[spread > 1]:
        yield Fault("splits", f"building {building} leaks: it is in more than one split")
    folds = manifest.split.folds if manifest.split else None
    names = {f"fold-{k}" for k in range(folds)} if folds else {"train", "val", "test"}
    for name in sorted(set(splits["split"]) - names):
        yield Fault("splits", f"{name!r} is none of {', '.join(sorted(names))}")


def count_frames(frames: dict[str, pd.DataFrame], manifest: Manifest) -> dict[str, Counts]:
    """Count the cells `[1 + R, C]` of every scene, from the tables alone."""
    objects, scenes = frames["objects"], frames["scenes"]
    classified = objects[objects["class_index"].notna()]
    rows_of = classified.groupby("scene_id").indices
    rooms = classified["room_index"].to_numpy(np.int64)
    classes = classified["class_index"].to_numpy(np.int64)
    nobody = np.zeros(0, dtype=np.int64)
    width = len(manifest.class_map.classes)
    return {
        scene: count_cells(
            rooms[rows_of.get(scene, nobody)],
            classes[rows_of.get(scene, nobody)],
            shape=(size + 1, width),
        )
        for scene, size in zip(scenes["scene_id"], scenes["num_rooms"].tolist(), strict=True)
    }


def check_pairs(
    entry: FileEntry,
    table: pa.Table,
    *,
    cells: dict[str, Counts],
    splits: pd.DataFrame,
    manifest: Manifest,
) -> Iterator[Fault]:
    """Check one file of pairs against the objects, the splits and the recipe."""
    if manifest.pairs is None:
        yield Fault(entry.path, "there are pairs, but the manifest has no recipe of them")
        return
    keys = table.select(["scene_id", "draw", "node_index"]).to_pandas()
    inputs = histogram_column(table, "input").astype(np.int64)
    targets = histogram_column(table, "target").astype(np.int64)
    split = dict(zip(splits["scene_id"], splits["split"], strict=True))
    own = split_of_file(entry.path)
    for scene, rows in keys.groupby("scene_id", sort=False).indices.items():
        where = f"{entry.path}, {scene}"
        if split.get(str(scene)) != own:
            yield Fault(where, f"is of split {split.get(str(scene))}, not {own}")
            continue
        shape = (manifest.pairs.draws, *cells[str(scene)].shape)
        order = keys.iloc[rows]
        draws, nodes = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
        if (
            len(rows) != len(draws)
            or ((order["draw"] != draws) | (order["node_index"] != nodes)).any()
        ):
            yield Fault(
                where, f"expected draws 0..{shape[0] - 1} of nodes 0..{shape[1] - 1}, in order"
            )
            continue
        yield from _check_scene_pairs(
            where,
            inputs[rows].reshape(shape),
            targets[rows].reshape(shape),
            cells=cells[str(scene)],
            mask=manifest.pairs.mask,
        )


def _check_scene_pairs(
    where: str, inputs: Counts, targets: Counts, *, cells: Counts, mask: MaskRecipe
) -> Iterator[Fault]:
    if (targets != to_histograms(cells)).any():
        yield Fault(where, "target is not the histogram of the objects table")
    if (inputs > targets).any():
        yield Fault(where, "input is above target: a mask would have added objects")
    null_region = inputs[:, 0] - inputs[:, 1:].sum(axis=1)
    if (null_region < 0).any() or (null_region > cells[0]).any():
        yield Fault(where, "the building's input is not the sum of its rooms and the null region")
    hidden = (targets - inputs)[:, 0].sum(axis=1)
    low, high = hidden_bounds(cells, mask)
    for draw in np.flatnonzero((hidden < low) | (hidden > high))[:3]:
        expected = str(low) if low == high else f"{low} to {high}"
        yield Fault(where, f"draw {draw}: the mask hides {hidden[draw]} objects, not {expected}")


def check_every_scene_has_pairs(
    pairs: list[tuple[FileEntry, pa.Table]], splits: pd.DataFrame
) -> Iterator[Fault]:
    """Check that every scene that is split has pairs, in one file."""
    held = [scene for _, table in pairs for scene in table["scene_id"].unique().to_pylist()]
    for scene in sorted(set(splits["scene_id"]) - set(held)):
        yield Fault("pairs", f"{scene} has none")
    for scene in sorted(scene for scene, files in Counter(held).items() if files > 1):
        yield Fault("pairs", f"{scene} is in two files")
