"""Masked buildings: what a robot would have seen, beside what is there.

They are sampled from the objects of a dataset, or read from its stored pairs. Stored pairs hold
the masked histograms of the classes and which rooms were visited. What such a mask leaves of the
objects outside the classes is not stored: it follows from the same recipe, and is sampled for a
model that reads such objects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Counts, Ints
from bsg_data.dataset.categories import place_columns
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.errors import DatasetError
from bsg_data.observation.masks import sample_hidden, sample_visited, share_hidden
from bsg_data.observation.observation import Observation, stack
from bsg_data.observation.pairs import histogram_column, read_pairs
from bsg_data.observation.search_moment import MaskedCells, observe_search, sample_search
from bsg_data.recipes import MaskRecipe


@dataclass(frozen=True, eq=False)
class MaskedBuildings:
    """Buildings under masks, with the truth.

    Attributes:
        seen: what the masks leave of B buildings.
        targets: `[N, C]` histograms of what is there.
        draws: `[B]` number of each mask.
    """

    seen: Observation
    targets: Counts
    draws: Ints

    def __len__(self) -> int:
        """Return the number of masked buildings B."""
        return len(self.seen)

    @property
    def hidden(self) -> Counts:
        """Hidden counts, `[N, C]`."""
        return self.targets - self.seen.inputs

    def batches(self, size: int) -> Iterator[MaskedBuildings]:
        """Yield the buildings in order, some at a time."""
        for first in range(0, len(self), size):
            yield self.take(range(first, min(first + size, len(self))))

    def take(self, buildings: Sequence[int] | Ints) -> MaskedBuildings:
        """Return some of the buildings, in the order that is asked for."""
        starts = self.seen.starts
        rows = [np.arange(starts[number], starts[number + 1]) for number in buildings]
        chosen = np.asarray(buildings, dtype=np.int64)
        return MaskedBuildings(
            self.seen.take(chosen), self.targets[np.concatenate(rows)], self.draws[chosen]
        )


def stack_masked(parts: Sequence[MaskedBuildings]) -> MaskedBuildings:
    """Return several records as one of all their buildings, in order."""
    return MaskedBuildings(
        stack([part.seen for part in parts]),
        np.concatenate([part.targets for part in parts]),
        np.concatenate([part.draws for part in parts]),
    )


def sample_masked(
    data: Dataset,
    scenes: Sequence[str],
    *,
    mask: MaskRecipe,
    draw: int,
    fractions: tuple[float, float] | None = None,
    withhold: float = 0.0,
    vocabulary: tuple[str, ...] = (),
) -> MaskedBuildings:
    """Sample mask number `draw` of some buildings.

    Args:
        data: an open dataset.
        scenes: of it, one or more.
        mask: whose strategy, fraction and seed are used.
        draw: number of the mask.
        fractions: from where to where the fraction varies from mask to mask, instead of that of
            `mask`.
        withhold: share of the classes to withhold; above 0 some rooms were searched, see
            `bsg_data.observation.search_moment`.
        vocabulary: categories outside the classes that are looked for.
    """
    recipes = _vary(mask, fractions, draw, len(scenes))
    return MaskedBuildings(
        stack(
            [
                _observe(data, scene, recipe, draw, withhold, vocabulary)
                for scene, recipe in zip(scenes, recipes, strict=True)
            ]
        ),
        np.concatenate([to_histograms(data.cells(scene)) for scene in scenes]),
        np.full(len(scenes), draw, dtype=np.int64),
    )


def read_masked(data: Dataset, split: str, *, vocabulary: tuple[str, ...] = ()) -> MaskedBuildings:
    """Read the stored pairs of one split or fold; from memory if they were read before.

    Raises:
        DatasetError: if there are none.
    """
    if data.manifest.pairs is None:
        raise DatasetError(f"{data.path}: has no pairs; run `bsg-data pairs` first")
    return _read_masked(data, split, vocabulary)


@lru_cache(maxsize=32)
def _read_masked(data: Dataset, split: str, vocabulary: tuple[str, ...]) -> MaskedBuildings:
    recipe = data.manifest.pairs.mask if data.manifest.pairs else MaskRecipe()
    table = read_pairs(data.path, split, manifest=data.manifest)
    inputs = histogram_column(table, "input").astype(np.int64)
    visited = table["visited"].to_numpy()
    starts = np.flatnonzero(table["node_index"].to_numpy() == 0)
    scenes = table["scene_id"].take(starts).to_pylist()
    draws = table["draw"].take(starts).to_numpy().astype(np.int64)
    parts = []
    for scene, draw, a, b in zip(scenes, draws, starts, [*starts[1:], len(table)], strict=True):
        others = see_others(data, scene, recipe, int(draw), visited[a:b], vocabulary=vocabulary)
        parts.append(
            Observation(
                scene_ids=(scene,),
                starts=np.array([0, b - a]),
                inputs=inputs[a:b],
                hidden_share=share_hidden(visited[a:b], recipe).astype(np.float32),
                visited=visited[a:b],
                withheld=np.zeros_like(inputs[a:b], dtype=bool),
                vocabulary=vocabulary,
                others=to_histograms(others),
                connections=data.connections(scene),
            )
        )
    targets = histogram_column(table, "target").astype(np.int64)
    masked = MaskedBuildings(stack(parts), targets, draws)
    for array in (masked.seen.inputs, masked.seen.hidden_share, masked.seen.others, targets):
        array.setflags(write=False)  # all readers of these pairs share them
    return masked


def see_others(
    data: Dataset,
    scene: str,
    mask: MaskRecipe,
    draw: int,
    visited: Bools,
    *,
    vocabulary: tuple[str, ...],
) -> Counts:
    """Return what a mask leaves of the objects outside the classes, `[N, V]` cells.

    All of them are masked, whatever the vocabulary, so that a mask does not depend on it.
    """
    if not vocabulary:
        return np.zeros((len(visited), 0), dtype=np.int64)
    others = data.others(scene)
    hidden = sample_hidden(
        others.cells, visited, mask, scene_id=scene, draw=draw, stream="unclassified"
    )
    return place_others(others.cells - hidden, others.categories, vocabulary)


def place_others(cells: Counts, categories: tuple[str, ...], vocabulary: tuple[str, ...]) -> Counts:
    """Return cells `[N, K]` by category in the columns of a vocabulary, `[N, V]`."""
    columns = _place_once(categories, vocabulary)
    placed = np.zeros((len(cells), len(vocabulary)), dtype=np.int64)
    placed[:, columns[columns >= 0]] = cells[:, columns >= 0]
    return placed


@lru_cache(maxsize=4096)
def _place_once(categories: tuple[str, ...], vocabulary: tuple[str, ...]) -> npt.NDArray[np.int64]:
    return place_columns(categories, vocabulary)


def _observe(
    data: Dataset,
    scene: str,
    mask: MaskRecipe,
    draw: int,
    withhold: float,
    vocabulary: tuple[str, ...],
) -> Observation:
    cells, connections = data.cells(scene), data.connections(scene)
    visited = sample_visited(cells, mask, scene_id=scene, draw=draw, connections=connections)
    left = cells - sample_hidden(cells, visited, mask, scene_id=scene, draw=draw)
    others = see_others(data, scene, mask, draw, visited, vocabulary=vocabulary)
    if withhold:
        searched, classes = sample_search(
            mask, scene_id=scene, draw=draw, shape=cells.shape, withhold=withhold
        )
        every = data.others(scene)
        return observe_search(
            scene,
            MaskedCells(cells, left[None]),
            MaskedCells(place_others(every.cells, every.categories, vocabulary), others[None]),
            searched=searched[None],
            withheld=classes[None],
            fraction=mask.fraction,
            vocabulary=vocabulary,
            connections=connections,
        )
    return Observation(
        scene_ids=(scene,),
        starts=np.array([0, len(cells)]),
        inputs=to_histograms(left),
        hidden_share=share_hidden(visited, mask).astype(np.float32),
        visited=visited,
        withheld=np.zeros_like(cells, dtype=bool),
        vocabulary=vocabulary,
        others=to_histograms(others),
        connections=connections,
    )


def _vary(
    mask: MaskRecipe, fractions: tuple[float, float] | None, draw: int, buildings: int
) -> list[MaskRecipe]:
    """Return the mask of every building, in their order; fractions that vary are in hundredths."""
    if fractions is None:
        return [mask] * buildings
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence([mask.seed, draw])))
    drawn = rng.uniform(*fractions, size=buildings).round(2).clip(*fractions).tolist()
    return [mask.model_copy(update={"fraction": fraction}) for fraction in drawn]
