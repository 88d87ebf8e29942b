"""Masked buildings: what a robot would have seen, with the true histograms.

They are sampled from the objects of a dataset, or read from its stored pairs. Stored pairs hold the
masked histograms and the view. They do not hold the objects outside the classes. For a model that
reads such objects, these are sampled again by the same recipe.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
import pyarrow as pa

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import place_columns, to_cells, to_histograms
from bsg_data.observation.masks import sample_view
from bsg_data.observation.observation import Observation, stack
from bsg_data.observation.pairs import list_column, read_views, stream_pairs
from bsg_data.observation.view import View, sample_hidden, sample_others
from bsg_data.recipes import MaskRecipe

BATCH = 256  # buildings in memory at a time
_place_columns = lru_cache(maxsize=4096)(place_columns)


@dataclass(frozen=True, eq=False)
class MaskedBuildings:
    """B buildings under masks, with their true histograms."""

    UNKNOWN: ClassVar[int] = -1  # target of a class that the building's source has no word for

    seen: Observation
    targets: Counts  # [N, C]
    draws: Ints  # [B] number of each mask
    nodes: Ints  # [N] index of each node in its building

    def __len__(self) -> int:
        """Return the number of masked buildings B."""
        return len(self.seen)

    @property
    def hidden(self) -> Counts:
        """Hidden counts, target − input, `[N, C]`; 0 where the target is not known."""
        return np.where(self.known, self.targets - self.seen.inputs, 0)

    @property
    def known(self) -> Bools:
        """Whether the target is known, `[N, C]`."""
        return np.asarray(self.targets != self.UNKNOWN)

    def batches(self, size: int) -> Iterator[MaskedBuildings]:
        """Yield the buildings in order, `size` at a time."""
        for first in range(0, len(self), size):
            yield self.take(range(first, min(first + size, len(self))))

    def take(self, buildings: Sequence[int] | Ints) -> MaskedBuildings:
        """Return the buildings with these numbers, in this order."""
        chosen = np.asarray(buildings, dtype=np.int64)
        seen = self.seen.take(chosen)
        rows, _ = self.seen.rows_of(chosen)
        return MaskedBuildings(seen, self.targets[rows], self.draws[chosen], self.nodes[rows])


def stack_masked(parts: Sequence[MaskedBuildings]) -> MaskedBuildings:
    """Return one record with the buildings of several, in order."""
    return MaskedBuildings(
        stack([part.seen for part in parts]),
        np.concatenate([part.targets for part in parts]),
        np.concatenate([part.draws for part in parts]),
        np.concatenate([part.nodes for part in parts]),
    )


def stream_sampled(
    data: Dataset,
    scenes: Sequence[str],
    *,
    mask: MaskRecipe,
    draw: int,
    vocabulary: tuple[str, ...] = (),
) -> Iterator[MaskedBuildings]:
    """Yield mask number `draw` of some buildings in order, `BATCH` at a time.

    Scenes in the order of the tables read each part of these once.
    """
    for first in range(0, len(scenes), BATCH):
        some = scenes[first : first + BATCH]
        yield sample_masked(data, some, mask=mask, draw=draw, vocabulary=vocabulary)


def sample_masked(
    data: Dataset,
    scenes: Sequence[str],
    *,
    mask: MaskRecipe | Sequence[MaskRecipe],
    draw: int,
    vocabulary: tuple[str, ...] = (),
) -> MaskedBuildings:
    """Sample mask number `draw` of one building or more, by one recipe or each by its own.

    The `vocabulary` has the categories outside the classes that are looked for.
    """
    recipes = [mask] * len(scenes) if isinstance(mask, MaskRecipe) else mask
    seen, targets, nodes = [], [], []
    for scene, recipe in zip(scenes, recipes, strict=True):
        view = view_building(data, scene, recipe, draw)
        cells = view.cut(data.cells(scene))
        hidden = sample_hidden(cells, view, recipe, scene_id=scene, draw=draw)
        seen.append(_observe(data, scene, recipe, draw, view, cells - hidden, hidden, vocabulary))
        targets.append(
            np.where(data.nameable(scene), to_histograms(cells), MaskedBuildings.UNKNOWN)
        )
        nodes.append(view.nodes)
    return MaskedBuildings(
        stack(seen),
        np.concatenate(targets),
        np.full(len(scenes), draw, dtype=np.int64),
        np.concatenate(nodes),
    )


def view_building(data: Dataset, scene: str, mask: MaskRecipe, draw: int) -> View:
    """Return how much a mask shows of a building of a dataset."""
    return sample_view(
        data.cells(scene).shape,
        mask,
        scene_id=scene,
        draw=draw,
        connections=data.connections(scene),
        nameable=data.nameable(scene),
    )


def vary_fractions(
    mask: MaskRecipe, fractions: tuple[float, float] | None, draw: int, buildings: int
) -> list[MaskRecipe]:
    """Return one mask per building, in order; varying fractions are whole hundredths."""
    if fractions is None:
        return [mask] * buildings
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence([mask.seed, draw])))
    drawn = rng.uniform(*fractions, size=buildings).round(2).clip(*fractions).tolist()
    recipes = {
        fraction: mask.model_copy(update={"fraction": fraction}) for fraction in sorted(set(drawn))
    }
    return [recipes[fraction] for fraction in drawn]


def stream_masked(
    data: Dataset,
    split: str,
    *,
    vocabulary: tuple[str, ...] = (),
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs of one split or fold, a file at a time.

    Raises:
        DatasetError: if there are none.
    """
    for table in stream_pairs(data, split):
        yield _read_table(data, table, vocabulary)


def _read_table(data: Dataset, table: pa.Table, vocabulary: tuple[str, ...]) -> MaskedBuildings:
    inputs = list_column(table, "input").astype(np.int64)
    targets = list_column(table, "target").astype(np.int64)
    views, recipe = read_views(table), data.manifest.pairs
    mask = recipe.mask if recipe else MaskRecipe()
    starts = np.flatnonzero(views.nodes == 0)
    scenes = table["scene_id"].take(starts).to_pylist()
    draws = table["draw"].take(starts).to_numpy().astype(np.int64)
    parts = []
    for scene, draw, a, b in zip(scenes, draws, starts, [*starts[1:], len(table)], strict=True):
        view, seen = views.take(int(a), int(b)), to_cells(inputs[a:b])
        if vocabulary:
            view = _refine(data, scene, mask, int(draw), view)
        hidden = to_cells(targets[a:b]) - seen
        parts.append(_observe(data, scene, mask, int(draw), view, seen, hidden, vocabulary))
        targets[a:b, ~data.nameable(scene)] = MaskedBuildings.UNKNOWN
    return MaskedBuildings(stack(parts), targets, draws, views.nodes)


def _refine(data: Dataset, scene: str, mask: MaskRecipe, draw: int, stored: View) -> View:
    """Return a stored view as it was drawn, under which objects outside the classes are hidden."""
    view = view_building(data, scene, mask, draw)
    # Where another version of NumPy drew the pairs, what is stored counts.
    return view if view.agrees(stored) else replace(stored, exact=view.exact)


def see_others(
    data: Dataset,
    scene: str,
    mask: MaskRecipe,
    draw: int,
    view: View,
    hidden: Counts,
    *,
    vocabulary: tuple[str, ...],
) -> Counts:
    """Return the objects outside the classes that a mask shows under its view, `[N, V]` cells.

    All such objects are masked before the vocabulary selects some, so it does not change a mask.
    `hidden` `[N, C]` are the classified objects that the mask hides.
    """
    if not vocabulary:
        return np.zeros((len(hidden), 0), dtype=np.int64)
    others = data.others(scene)
    seen = sample_others(
        others,
        view,
        mask,
        scene_id=scene,
        draw=draw,
        there=view.cut(data.cells(scene)),
        hidden=hidden,
        classes=data.manifest.class_space.classes,
    )
    return place_others(seen, others.categories, vocabulary)


def place_others(cells: Counts, categories: tuple[str, ...], vocabulary: tuple[str, ...]) -> Counts:
    """Return cells `[N, K]` by category in the columns of a vocabulary, `[N, V]`."""
    columns = _place_columns(categories, vocabulary)
    placed = np.zeros((len(cells), len(vocabulary)), dtype=np.int64)
    placed[:, columns[columns >= 0]] = cells[:, columns >= 0]
    return placed


def _observe(
    data: Dataset,
    scene: str,
    mask: MaskRecipe,
    draw: int,
    view: View,
    seen: Counts,
    hidden: Counts,
    vocabulary: tuple[str, ...],
) -> Observation:
    """Return what is seen of a building under a view; of its cells are seen and hidden `[N, C]`."""
    connections, surroundings = data.connections(scene), data.surroundings(scene)
    if len(view.nodes) < len(surroundings):
        connections = connections.among(view.nodes)
        surroundings = surroundings.take(view.nodes, buildings=slice(None))
    return Observation.of_building(
        scene,
        view,
        seen,
        see_others(data, scene, mask, draw, view, hidden, vocabulary=vocabulary),
        vocabulary=vocabulary,
        connections=connections,
        surroundings=surroundings,
    )
