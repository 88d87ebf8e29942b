"""Masked buildings as PyG graphs: what was seen, and what is there (sections II and III-B).

The nodes of interest 𝒩 of a building are itself (η, node 0) and its rooms (ρ). Each has a histogram
over the C classes of the objects in it: E′ × O′ of the input graph 𝒢′, of which objects were
deleted, and E × O of the ground truth 𝒢. E sums to 1, and O is the number of objects; the product
is the vector of counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch_geometric.data import Data
from torch_geometric.data import Dataset as GraphDataset

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.files import AnyPath
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.folds import Split, scenes_of
from bsg_models.inputs.graphs import read_split
from bsg_models.inputs.nodes import list_edges
from bsg_models.zoo.settings import EdgeSet

_BOTH: tuple[EdgeSet, ...] = ("up", "down")


def to_graph(seen: Observation, *, edges: Sequence[EdgeSet], targets: Counts | None = None) -> Data:
    """Return an observation as one graph, in which buildings are not connected with each other.

    It has `x` `[N, C]`, E′ × O′; `edge_index` `[2, E]`; `is_building`, `visited` and `hidden_share`
    `[N]`; `withheld` `[N, C]`; `unclassified` `[N, V]`; and `y` `[N, C]`, E × O, below 0 where the
    source has no word for the class, if the targets are given.

    Its surroundings are `floor_area` `[N]` in square metres, 0 if unknown; `labels` `[N, L]`, all 0
    if unknown; `building_kind` and `source` `[N]`, each an index in `BUILDING_KINDS` and
    `KNOWN_SOURCES`, -1 if unknown.
    """
    around = seen.surroundings
    graph = Data(
        x=torch.tensor(seen.inputs, dtype=torch.float32),
        edge_index=torch.from_numpy(list_edges(seen, edges)),
        is_building=torch.tensor(seen.is_building),
        unclassified=torch.tensor(seen.unclassified, dtype=torch.float32),
        visited=torch.tensor(seen.visited),
        hidden_share=torch.tensor(seen.hidden_share),
        withheld=torch.tensor(seen.withheld),
        floor_area=torch.tensor(np.nan_to_num(around.floor_area), dtype=torch.float32),
        labels=torch.tensor(around.labels, dtype=torch.float32),
        building_kind=torch.tensor(around.building_kinds[seen.building]),
        source=torch.tensor(around.sources[seen.building]),
    )
    if targets is not None:
        graph.y = torch.tensor(targets, dtype=torch.float32)
    return graph


class MaskedGraphs(GraphDataset):  # type: ignore[misc]
    """Masked buildings as a PyG dataset, one graph each, with `scene_id` and `draw`."""

    def __init__(self, masked: MaskedBuildings, *, edges: Sequence[EdgeSet] = _BOTH) -> None:
        super().__init__()
        self.masked = masked
        self._whole = to_graph(masked.seen, edges=edges, targets=masked.targets)
        self._nodes = masked.seen.starts.tolist()  # [B + 1]
        sources = self._whole.edge_index[0].numpy()  # of the edges, which are sorted by it
        self._edges = np.searchsorted(sources, masked.seen.starts).tolist()

    @classmethod
    def stored(
        cls,
        path: AnyPath,
        split: Split,
        *,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = _BOTH,
    ) -> MaskedGraphs:
        """Read the stored pairs of a split of a dataset.

        Raises:
            DatasetError: if there are none.
        """
        return cls(read_split(Dataset.open(path), split, fold=fold), edges=edges)

    @classmethod
    def fresh(
        cls,
        path: AnyPath,
        split: Split,
        *,
        mask: MaskRecipe,
        draw: int,
        fold: int | None = None,
        edges: Sequence[EdgeSet] = _BOTH,
    ) -> MaskedGraphs:
        """Sample mask number `draw` of every building of a split."""
        data = Dataset.open(path)
        scenes = scenes_of(data, split, fold=fold)
        return cls(sample_masked(data, scenes, mask=mask, draw=draw), edges=edges)

    def len(self) -> int:
        """Return the number of masked buildings."""
        return len(self.masked)

    def get(self, idx: int) -> Data:
        """Return one masked building as a graph."""
        nodes, edges = (slice(*ends[idx : idx + 2]) for ends in (self._nodes, self._edges))
        graph = Data(scene_id=self.masked.seen.scene_ids[idx], draw=int(self.masked.draws[idx]))
        for name, values in self._whole:
            graph[name] = values[:, edges] - nodes.start if name == "edge_index" else values[nodes]
        return graph
