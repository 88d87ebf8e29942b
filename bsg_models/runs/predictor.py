"""Apply a trained model to one partial graph after another, as a robot does."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from bsg_data.arrays import Bools
from bsg_data.errors import ClassMapError, MismatchError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.observation import Observation, stack
from bsg_data.scene.class_map import (
    ClassMap,
    OwnMap,
    join_maps,
    load_class_map,
    map_into,
    parse_own_map,
    published_maps,
)
from bsg_data.seal import read_seal
from bsg_models.belief.expectation import Expectation, mix_copies
from bsg_models.belief.hidden_share import ShareBelief
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.errors import CheckpointError
from bsg_models.inputs.hidden_shares import spread_shares, update_shares
from bsg_models.runs.checkpoint import CheckpointHeader, load_checkpoint, restore_model
from bsg_models.runs.found_model import DEFAULT_MODEL, find_model, read_shipped_card, weights_folder
from bsg_models.zoo.model import one_thread


class Predictor:
    """A trained model, loaded once: a shipped model, a run, or a hub model.

    Attributes:
        name: a shipped model's own name, else that in the zoo.
        classes: `[C]` that it predicts.
        class_space: of these classes.
        vocabulary: categories outside the classes that the model reads as evidence.
        untaught: classes of which no train building had an object: none is expected anywhere.
        reads_labels: whether the model reads the kinds of rooms.
        fold: of its dataset that it was trained without; None without folds.

    Examples:
        >>> predictor = Predictor()  # doctest: +SKIP
        >>> predictor(graph).presence.shape  # doctest: +SKIP
        (15, 45)
    """

    def __init__(self, model: AnyPath = DEFAULT_MODEL) -> None:
        """Load a model.

        Args:
            model: path of a run, or a name, as `find_model` takes it.

        Raises:
            CheckpointError: if there is no such model, or it is damaged.
        """
        found = find_model(model)
        path = self._path = found.path
        checkpoint = load_checkpoint(path)
        self._header = checkpoint.header
        self.class_space = self._header.class_space
        self._model = restore_model(path, checkpoint)
        self.name = found.name if found.kind == "shipped" else self._header.config.name
        self.classes, self.untaught = self.class_space.classes, self._header.untaught
        self.vocabulary, self.reads_labels = self._model.vocabulary, self._model.reads_labels
        self.fold = self._header.config.data.fold

    @cached_property
    def is_free(self) -> bool:
        """Whether it is a shipped model that everybody may use for anything, as its card says."""
        from bsg_models.runs.model_card import read_card  # an answer reads no card

        sha256, shipped = hash_file(self._path), read_seal(weights_folder()) or {}
        names = [Path(file).stem for file, listed in shipped.items() if listed == sha256]
        cards = (read_card(read_shipped_card(name), origin=name) for name in names)
        return any(not card.is_restricted for card in cards)

    @cached_property
    def class_map(self) -> ClassMap:
        """The class map from a robot's words to the classes of the model.

        A model trained with the user's own class map contains it. Other models use HM3D's map,
        which has everyday words.

        Raises:
            CheckpointError: if the checkpoint lacks its class map, or has another one.
        """
        return choose_class_map(self._path, self._header)

    def __call__(
        self,
        *graphs: PartialGraph,
        withheld: Collection[int] | Bools = (),
        weigh_seen: bool = True,
    ) -> Expectation:
        """Return what the model believes about a partial graph, or about several, one by one.

        If the hidden share of a room is uncertain, the seen objects narrow it (`believe_shares`).
        The answer then mixes the model's expectations at several shares, which takes two passes. If
        all shares are certain, it takes one.

        Args:
            graphs: what was seen of one building, or of several, whose nodes follow each other.
            withheld: classes left out of the graph in rooms that were not searched, so that their
                absence is no evidence; a search withholds its artifacts. Or a mask `[1 + R, C]` by
                node and class.
            weigh_seen: whether seen objects narrow uncertain shares; False if the robot has used
                them for its shares already.

        Raises:
            MismatchError: if a graph has another class space.
            PredictionError: if the answer is not finite.
        """
        seen = stack([self._observe(graph, withheld) for graph in graphs])
        with one_thread():
            updated = self._update_shares(graphs, seen) if weigh_seen else graphs
            levels, weights = spread_shares(updated, seen)
            expectation = self._model.expect(levels)
            if len(weights) > 1:
                expectation = mix_copies(expectation, weights)
            # The paper's model does not read the hidden share, and expects some in a searched room.
            left = expectation.hidden_counts.without(seen.cell_share == 0)
        return Expectation(expectation.inputs, left, expectation.raw_totals)

    def believe_shares(
        self, graph: PartialGraph, *, withheld: Collection[int] | Bools = ()
    ) -> tuple[ShareBelief, ...]:
        """Return the belief about the hidden share of every room `[R]`, given what was seen.

        A call averages over these beliefs. If the model expects more than was seen, more is hidden.

        Args:
            graph: what was seen; a certain share stays, and an unknown one starts from `VAGUE`.
            withheld: as for a call; such classes are no evidence for the share.

        Raises:
            MismatchError: if the graph has another class space.
            PredictionError: if the answer is not finite.
        """
        seen = self._observe(graph, withheld)
        with one_thread():
            (after,) = self._update_shares([graph], seen)
        return tuple(room.share for room in after.rooms)

    def _update_shares(
        self, graphs: Sequence[PartialGraph], seen: Observation
    ) -> Sequence[PartialGraph]:
        """Return graphs whose shares are updated by the classes that the model was taught."""
        if all(room.share.is_certain for graph in graphs for room in graph.rooms):
            return graphs
        if self._model.untaught is not None:
            seen = replace(seen, withheld=seen.withheld | self._model.untaught)
        apart = self._model.with_independent_rooms()
        return update_shares(graphs, seen, expect_rooms=apart.expect_rooms)

    def _observe(self, graph: PartialGraph, withheld: Collection[int] | Bools) -> Observation:
        if graph.class_space != self.class_space:
            raise MismatchError(
                f"{self._path} predicts classes of {self.class_space}, the graph "
                f"{graph.scene_id} has those of {graph.class_space}; read the graph with a "
                f"class map into {self.class_space.name}: "
                "read_robot_graph(path, class_map=predictor.class_map)"
            )
        return graph.observation(vocabulary=self.vocabulary, withheld=withheld)


def choose_class_map(path: Path, header: CheckpointHeader) -> ClassMap:
    """Return the class map from a robot's words to the classes of a model.

    The user's own maps come first, in the order of the dataset's sources; if two list a word, the
    earlier decides. HM3D's words are added unless every source has a map of the user's own.
    """
    own = [entry for entry in header.class_maps if isinstance(entry, OwnMap)]
    named = [entry for entry in header.class_maps if isinstance(entry, str)]
    space = header.class_space
    try:
        maps = [parse_own_map(entry) for entry in own]
        if not own or any(name in published_maps() for name in named):
            maps.append(load_class_map(map_into(space.name)))
        joined = join_maps(*maps)
    except ClassMapError as error:
        raise CheckpointError(
            f"{path}: {error}. A checkpoint holds the class map only if its dataset does: "
            "build the dataset again with `bsg-data build`, and train again"
        ) from error
    if joined.space != space:
        raise CheckpointError(
            f"{path}: predicts classes of {space}, and its class map {joined.version} leads into "
            f"{joined.space}; train again"
        )
    return joined
