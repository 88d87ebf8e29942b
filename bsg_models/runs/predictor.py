"""Ask a trained model about one partial graph after another, as a robot does."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_data.errors import MismatchError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_models.inputs.graphs import EdgeSet, connect
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import checkpoint_of


class Predictor:
    """A model of a finished run, loaded once.

    Attributes:
        name: of the model, as in the zoo.
        classes: `[C]` that it predicts.

    Example:
        >>> predictor = Predictor(Path("run"))  # doctest: +SKIP
        >>> predictor(graph).presence.shape  # doctest: +SKIP
        (15, 45)
    """

    def __init__(self, run: Path) -> None:
        """Load the best checkpoint of a run.

        Raises:
            CheckpointError: if there is none, or it is damaged.
        """
        path = checkpoint_of(run)
        checkpoint = load_checkpoint(path)
        self._path = path
        self._class_map = checkpoint.header.class_map
        self._edges = checkpoint.header.config.data.edges
        self._model = restore_model(path, checkpoint)
        self.name = checkpoint.header.config.model.family
        self.classes = self._class_map.classes

    def __call__(self, graph: PartialGraph, *, withheld: Collection[int] = ()) -> Expectation:
        """Return what the model believes about a partial graph.

        Args:
            graph: what was seen.
            withheld: classes that the graph leaves out of rooms which were not searched, so that
                none being there says nothing; a search is told nothing of its artifact.

        Raises:
            MismatchError: if the graph is of another class map.
            PredictionError: if the answer is not finite.
        """
        if graph.class_map != self._class_map:
            raise MismatchError(
                f"{self._path} predicts classes of {self._class_map.version}, the graph "
                f"{graph.scene_id} has those of {graph.class_map.version}"
            )
        data = to_data(
            graph, edges=self._edges, vocabulary=self._model.vocabulary, withheld=withheld
        )
        return _nothing_where_searched(self._model.expect(data), graph)


def _nothing_where_searched(found: Expectation, graph: PartialGraph) -> Expectation:
    """Return the expectation without hidden objects in rooms of which all was seen.

    Models that read the share say so themselves; the paper's does not read it.
    """
    searched = graph.shares() == 0
    if not searched[1:].any():
        return found
    hides = np.where(searched, 0.0, 1.0)[None, :, None]
    distribution = CountDistribution(
        found.hidden_counts.means * hides,
        found.hidden_counts.dispersions,
        found.hidden_counts.weights,
    )
    return Expectation(found.inputs, distribution, found.totals)


def to_data(
    graph: PartialGraph,
    *,
    edges: tuple[EdgeSet, ...],
    vocabulary: tuple[str, ...],
    withheld: Collection[int] = (),
) -> Data:
    """Return a partial graph as models read it; see `MaskedGraphs` for its fields.

    Args:
        graph: with R rooms.
        edges: among the building and its rooms.
        vocabulary: categories outside the classes that the model reads.
        withheld: classes that are left out of rooms which were not searched.
    """
    inputs, shares = graph.histograms(), graph.shares()
    hides = np.isin(np.arange(inputs.shape[1]), list(withheld)) & (shares > 0)[:, None]
    nodes = len(inputs)
    adjacent = graph.adjacency
    return Data(
        x=torch.from_numpy(inputs).float(),
        edge_index=connect(nodes, edges, adjacent=adjacent),
        adjacent_index=connect(nodes, ("adjacent",), adjacent=adjacent),
        is_building=torch.arange(nodes) == 0,
        others=torch.from_numpy(graph.others(vocabulary)).float(),
        visited=torch.from_numpy(graph.visited()),
        fraction=torch.from_numpy(shares).float(),
        withheld=torch.from_numpy(hides),
        scene_id=graph.scene_id,
    )
