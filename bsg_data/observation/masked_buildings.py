"""Masked buildings: what a robot would have seen, with the true histograms.

They are sampled from the objects of a dataset, or read from its stored pairs. Stored pairs hold the
masked histograms and the view. They do not hold the objects outside the classes. For a model that
reads such objects, these are sampled again by the same recipe.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.dataset.dataset import Building, Dataset
from bsg_data.dataset.histograms import stack_histograms
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import Layout, sample_masks, sample_views
from bsg_data.observation.observation import Observation, stack
from bsg_data.observation.pairs import list_column, read_views, stream_pairs
from bsg_data.observation.view import View, see_unclassified
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections
from bsg_data.scene.surroundings import Surroundings

BATCH = 256  # buildings in memory at a time


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

    def without_categories(self) -> MaskedBuildings:
        """Return the buildings without their objects outside the classes."""
        none = np.zeros((len(self.seen.inputs), 0), dtype=np.int64)
        return replace(self, seen=replace(self.seen, vocabulary=(), unclassified=none))


def stack_masked(several: Sequence[MaskedBuildings]) -> MaskedBuildings:
    """Return one record with the buildings of several, in order."""
    return MaskedBuildings(
        stack([masked.seen for masked in several]),
        np.concatenate([masked.targets for masked in several]),
        np.concatenate([masked.draws for masked in several]),
        np.concatenate([masked.nodes for masked in several]),
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

    Scenes in the order of the tables read each shard of these once.
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
    draws = _Draws(data, scenes, recipes, np.full(len(scenes), draw))
    cells = [building.cells for building in draws.buildings]
    views, present, hidden = sample_masks(cells, draws.layouts, draws.streams)
    starts = np.cumsum([0, *(len(view.nodes) for view in views)])[:-1]
    targets, hidden = stack_histograms(present, starts), stack_histograms(hidden, starts)
    return draws.mask(views, targets, hidden, vocabulary)


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
    data: Dataset, split: str, *, vocabulary: tuple[str, ...] = ()
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs of one split or fold, about a row group at a time.

    Raises:
        DatasetError: if there are none.
    """
    recipe = data.manifest.pairs
    mask = MaskRecipe() if recipe is None else recipe.mask
    for table in stream_pairs(data, split):
        stored = read_views(table)
        starts = np.flatnonzero(stored.nodes == 0)
        scenes, numbers = (table[name].take(starts) for name in ("scene_id", "draw"))
        recipes = [mask] * len(starts)
        draws = _Draws(data, scenes.to_pylist(), recipes, numbers.to_numpy().astype(np.int64))
        views = [stored.take(*span) for span in pairwise([*starts.tolist(), len(table)])]
        if vocabulary:
            views = list(map(_refine, sample_views(draws.layouts, draws.streams), views))
        seen, targets = (list_column(table, name).astype(np.int64) for name in ("input", "target"))
        yield draws.mask(views, targets, targets - seen, vocabulary)


def _refine(drawn: View, stored: View) -> View:
    """Return a stored view as it was drawn, under which objects outside the classes are hidden."""
    # Where another version of NumPy drew the pairs, what is stored counts.
    return drawn if drawn.agrees(stored) else replace(stored, exact=drawn.exact)


@dataclass(frozen=True, eq=False)
class _Draws:
    """M draws, each of the mask of a building."""

    data: Dataset
    scenes: Sequence[str]
    recipes: Sequence[MaskRecipe]
    numbers: Ints

    @cached_property
    def buildings(self) -> list[Building]:
        known = {scene: self.data.building(scene) for scene in dict.fromkeys(self.scenes)}
        return [known[scene] for scene in self.scenes]

    @cached_property
    def streams(self) -> MaskStreams:
        return MaskStreams(self.recipes, self.scenes, self.numbers.tolist())

    @property
    def layouts(self) -> list[Layout]:
        return [
            Layout(building.cells.shape, building.connections, building.nameable)
            for building in self.buildings
        ]

    def mask(
        self, views: Sequence[View], targets: Counts, hidden: Counts, vocabulary: tuple[str, ...]
    ) -> MaskedBuildings:
        """Return the buildings under views, with true and hidden histograms `[K, C]`."""
        sizes = [len(view.nodes) for view in views]
        outside = self._see_unclassified(views, targets, hidden, vocabulary)
        connections, surroundings = zip(*map(_cut, self.buildings, views), strict=True)
        seen = Observation.of_views(
            self.scenes,
            views,
            targets - hidden,
            stack_histograms(outside, np.cumsum([0, *sizes])[:-1]),
            vocabulary=vocabulary,
            connections=connections,
            surroundings=surroundings,
        )
        nameable = np.repeat([building.nameable for building in self.buildings], sizes, axis=0)
        targets = np.where(nameable, targets, MaskedBuildings.UNKNOWN)
        nodes = np.concatenate([view.nodes for view in views])
        return MaskedBuildings(seen, targets, self.numbers, nodes)

    def _see_unclassified(
        self, views: Sequence[View], present: Counts, hidden: Counts, vocabulary: tuple[str, ...]
    ) -> Counts:
        """Return the objects outside the classes that are seen, `[K, V]` cells.

        All such objects are masked before the vocabulary selects some, so it changes no mask.
        """
        if not vocabulary:
            return np.zeros((len(present), 0), dtype=np.int64)
        seen = see_unclassified(
            [self.data.unclassified(scene) for scene in self.scenes],
            views,
            self.streams,
            present=present,
            hidden=hidden,
            classes=self.data.manifest.class_space.classes,
        )
        return np.concatenate([objects.count(vocabulary) for objects in seen])


def _cut(building: Building, view: View) -> tuple[Connections, Surroundings]:
    """Return the connections and surroundings of the nodes in a robot's graph."""
    if len(view.nodes) == len(building.surroundings):
        return building.connections, building.surroundings
    taken = building.surroundings.take(view.nodes, buildings=slice(None))
    return building.connections.among(view.nodes), taken
