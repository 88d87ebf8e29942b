"""Read the stored pairs of a split, and convert them to PyG graphs for other networks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch_geometric.data import Data
from torch_geometric.data import Dataset as GraphDataset

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath
from bsg_data.observation.masked_buildings import (
    MaskedBuildings,
    sample_masked,
    stack_masked,
    stream_masked,
    vary_fractions,
)
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.edges import EdgeSet, list_edges
from bsg_models.inputs.folds import Split, scenes_of, splits_of
from bsg_models.inputs.nodes import to_nodes


def to_graph(seen: Observation, *, edges: Sequence[EdgeSet], targets: Counts | None = None) -> Data:
    """Return an observation as one graph, in which buildings are not connected with each other.

    It has `x` `[N, C]`, `unclassified` `[N, V]`, `edge_index` `[2, E]`, `is_building`, `visited`
    and `hidden_share` `[N]`, `withheld` `[N, C]`, and `y` `[N, C]` if the targets are given.

    Its surroundings are `floor_area` `[N]` in square metres, 0 if unknown; `labels` `[N, L]`, all 0
    if unknown; `building_kind` and `source` `[N]`, each an index in `BUILDING_KINDS` and
    `KNOWN_SOURCES`, -1 if unknown.

    Args:
        seen: what was seen.
        edges: among each building and its rooms.
        targets: `[N, C]` true histograms.
    """
    nodes = to_nodes(seen, targets=targets).to(torch.device("cpu"))
    around = seen.surroundings
    graph = Data(
        x=nodes.x,
        edge_index=torch.from_numpy(list_edges(seen, edges)),
        is_building=nodes.is_building,
        unclassified=nodes.unclassified,
        visited=nodes.visited,
        hidden_share=nodes.hidden_share,
        withheld=torch.from_numpy(seen.withheld.copy()),
        floor_area=torch.from_numpy(np.nan_to_num(around.floor_area).astype(np.float32)),
        labels=torch.from_numpy(around.labels.astype(np.float32)),
        building_kind=torch.from_numpy(around.building_kinds[seen.building]),
        source=torch.from_numpy(around.sources[seen.building]),
    )
    if targets is not None:
        graph.y = nodes.y
    return graph


def read_split(
    data: Dataset, split: Split, *, fold: int | None = None, vocabulary: tuple[str, ...] = ()
) -> MaskedBuildings:
    """Return the stored pairs of train, val or test.

    Raises:
        DatasetError: if there are none.
    """
    parts = list(stream_split(data, split, fold=fold, vocabulary=vocabulary))
    if not parts:
        raise DatasetError(
            f"{data.path}: no building of split {split!r} has pairs",
            code="pairs-missing",
            where=split,
        )
    return stack_masked(parts)


def stream_split(
    data: Dataset,
    split: Split,
    *,
    fold: int | None = None,
    vocabulary: tuple[str, ...] = (),
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs one file at a time: the data of `read_split`."""
    scenes = frozenset(scenes_of(data, split, fold=fold))
    for name in splits_of(data, split, fold=fold):
        for masked in stream_masked(data, name, vocabulary=vocabulary):
            chosen = [i for i, scene in enumerate(masked.seen.scene_ids) if scene in scenes]
            if len(chosen) == len(masked):
                yield masked
            elif chosen:
                yield masked.take(chosen)


class MaskedGraphs(GraphDataset):  # type: ignore[misc]
    """Masked buildings as a PyG dataset, one graph each; see `to_graph` for the fields.

    Each graph also has `scene_id` and `draw`.

    Examples:
        >>> graphs = MaskedGraphs.stored(Path("dataset"), "train")  # doctest: +SKIP
        >>> graphs[0].x.shape  # doctest: +SKIP
        torch.Size([15, 45])
    """

    def __init__(
        self, masked: MaskedBuildings, *, edges: Sequence[EdgeSet] = ("up", "down")
    ) -> None:
        super().__init__()
        self.masked = masked
        self._edges = tuple(edges)

    @classmethod
    def stored(
        cls,
        path: AnyPath | Dataset,
        split: Split,
        *,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = ("up", "down"),
        vocabulary: tuple[str, ...] = (),
    ) -> MaskedGraphs:
        """Read the stored pairs of a split, from a dataset's folder or an open dataset.

        Raises:
            DatasetError: if there are none.
        """
        data = path if isinstance(path, Dataset) else Dataset.open(path)
        return cls(read_split(data, split, fold=fold, vocabulary=vocabulary), edges=edges)

    @classmethod
    def fresh(
        cls,
        path: AnyPath | Dataset,
        split: Split,
        *,
        mask: MaskRecipe,
        draw: int,
        fractions: tuple[float, float] | None = None,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = ("up", "down"),
        vocabulary: tuple[str, ...] = (),
    ) -> MaskedGraphs:
        """Sample mask number `draw` of every building of a split.

        Args:
            path: folder of the dataset, or an open dataset.
            split: train, val or test.
            mask: how objects are hidden.
            draw: number of the mask.
            fractions: range of the fraction, which then varies from mask to mask; None uses that of
                `mask`.
            fold: to test on, in a dataset of folds.
            edges: of the graphs.
            vocabulary: categories of `unclassified`.
        """
        data = path if isinstance(path, Dataset) else Dataset.open(path)
        scenes = scenes_of(data, split, fold=fold)
        masked = sample_masked(
            data,
            scenes,
            mask=vary_fractions(mask, fractions, draw, len(scenes)),
            draw=draw,
            vocabulary=vocabulary,
        )
        return cls(masked, edges=edges)

    def len(self) -> int:
        """Return the number of masked buildings."""
        return len(self.masked)

    def get(self, idx: int) -> Data:
        """Return one masked building as a graph."""
        one = self.masked.take([idx])
        graph = to_graph(one.seen, edges=self._edges, targets=one.targets)
        graph.scene_id = one.seen.scene_ids[0]
        graph.draw = int(one.draws[0])
        return graph
