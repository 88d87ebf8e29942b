"""Ask a trained model about one partial graph after another, as a robot does."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from bsg_data.arrays import Bools
from bsg_data.errors import MismatchError
from bsg_data.observation.observation import Observation
from bsg_data.observation.partial_graph import PartialGraph
from bsg_models.belief.expectation import Expectation
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.found_model import find_model, name_model
from bsg_models.runs.shipped import DEFAULT_MODEL


class Predictor:
    """A trained model, loaded once: a shipped one, a run, or one of the hub.

    Attributes:
        name: of a shipped model its own, of another that in the zoo.
        classes: `[C]` that it predicts.

    Example:
        >>> predictor = Predictor()  # doctest: +SKIP
        >>> predictor(graph).presence.shape  # doctest: +SKIP
        (15, 45)
    """

    def __init__(self, model: Path | str = DEFAULT_MODEL) -> None:
        """Load a model.

        Args:
            model: what `find_model` takes: the path of a run, or a name.

        Raises:
            CheckpointError: if there is none, or it is damaged.
        """
        found = find_model(model)
        path = self._path = found.path
        checkpoint = load_checkpoint(path)
        self.class_space = checkpoint.header.class_space
        self._model = restore_model(path, checkpoint)
        self.name = name_model(found, checkpoint.header)
        self.classes = self.class_space.classes

    def __call__(
        self, graph: PartialGraph, *, withheld: Collection[int] | Bools = ()
    ) -> Expectation:
        """Return what the model believes about a partial graph.

        Args:
            graph: what was seen.
            withheld: classes that the graph leaves out of rooms which were not searched, so that
                none being there says nothing; a search is told nothing of its artifact. Or, by
                node and class, `[1 + R, C]` where nothing of a class is shown.

        Raises:
            MismatchError: if the graph is of another class map.
            PredictionError: if the answer is not finite.
        """
        if graph.class_space != self.class_space:
            raise MismatchError(
                f"{self._path} predicts classes of {self.class_space}, the graph "
                f"{graph.scene_id} has those of {graph.class_space}; read the graph with a "
                f"class map into {self.class_space.name}: read_robot_graph(path, class_map=NAME)"
            )
        seen = graph.observation(vocabulary=self._model.vocabulary, withheld=withheld)
        return _nothing_where_searched(self._model.expect(seen), seen)


def _nothing_where_searched(expectation: Expectation, seen: Observation) -> Expectation:
    """Return the expectation without hidden objects where all was seen.

    Models that read the share say so themselves. The paper's does not read it, and its `expect` may
    believe in hidden objects there.
    """
    known = seen.cell_share == 0
    if not known[1:].any():
        return expectation
    left = expectation.hidden_counts.without(known)
    return Expectation(expectation.inputs, left, expectation.totals)
