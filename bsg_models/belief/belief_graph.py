"""Make the belief graph 𝒢″: the partial graph with predicted histograms and blind nodes.

Source: the paper, section III-C. A blind node ℬ stands for an object that is expected in a room and
was not seen. Mode `complete` adds as many as the expected number of hidden objects. Mode `unseen`
adds one for each of the likeliest classes of which the room shows none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats
from bsg_data.errors import RecipeError
from bsg_data.words.shown import show_value
from bsg_models.belief.expectation import LEAST_PRESENCE, Expectation
from bsg_models.belief.partial_graph import PartialGraph

Mode = Literal["complete", "unseen"]


@dataclass(frozen=True, slots=True)
class BlindNode:
    """An expected object."""

    room_index: int  # where it is expected, 1..R
    class_index: int
    expected: float  # number of hidden objects of its class in the room
    presence: float  # P(at least one of them)
    on: str | None = None  # id of the seen piece of furniture where it probably is


@dataclass(frozen=True, eq=False)
class BeliefGraph:
    """A partial graph with what is believed about its N nodes, the building first."""

    partial: PartialGraph
    expected: Floats  # [N, C] counts of all objects, E″ × O″
    presence: Floats  # [N, C] P(at least one hidden object of the class)
    blind: tuple[BlindNode, ...]  # by room, the likeliest class first
    mode: Mode
    model: str

    @property
    def inputs(self) -> Floats:
        """Histograms of what was seen, E′ × O′, `[N, C]`."""
        return self.partial.histograms().astype(np.float64)

    @property
    def hidden(self) -> Floats:
        """Expected numbers of hidden objects, `[N, C]`."""
        return self.expected - self.inputs

    def __eq__(self, other: object) -> bool:
        """Return whether two belief graphs agree to the last bit."""
        if not isinstance(other, BeliefGraph):
            return NotImplemented
        return (
            (self.partial, self.blind, self.mode, self.model)
            == (other.partial, other.blind, other.mode, other.model)
            and np.array_equal(self.expected, other.expected)
            and np.array_equal(self.presence, other.presence)
        )

    __hash__ = None  # type: ignore[assignment]


def believe(
    graph: PartialGraph,
    expectation: Expectation,
    *,
    mode: Mode = "complete",
    top: int = 3,
    model: str = "",
    piece_of: Callable[[int, int], str | None] = lambda room, index: None,
) -> BeliefGraph:
    """Return the belief graph of a partial graph.

    Args:
        graph: with R rooms.
        expectation: of its nodes of interest, `[1 + R, C]`.
        mode: `complete` or `unseen`.
        top: number of classes per room that get a blind node under `unseen`.
        model: name to put into the result.
        piece_of: room, class → id of the seen piece of furniture where such an object probably is.

    Raises:
        RecipeError: if the expectation does not belong to this graph, or there is no such mode.
    """
    if mode not in get_args(Mode):
        expected = " or ".join(get_args(Mode))
        raise RecipeError(
            f"mode: expected {expected}, found {show_value(mode)}",
            code="mode-unknown",
            where="mode",
        )
    inputs = graph.histograms().astype(np.float64)
    if not np.array_equal(expectation.inputs, inputs):
        raise RecipeError(
            f"{graph.scene_id}: expected an expectation of the graph's {inputs.shape[0]} nodes and "
            f"{inputs.shape[1]} classes, found one of other inputs",
            code="expectation-foreign",
            where=graph.scene_id,
        )
    hidden, presence = expectation.hidden, expectation.presence
    chosen = (
        complete(hidden[1:])
        if mode == "complete"
        else [
            np.bincount(row, minlength=hidden.shape[1]) for row in rank_unseen(expectation, top)[1:]
        ]
    )
    blind = [
        BlindNode(
            room, int(c), float(hidden[room, c]), float(presence[room, c]), piece_of(room, int(c))
        )
        for room, numbers in enumerate(chosen, start=1)
        for c in sorted(np.flatnonzero(numbers), key=lambda c: (-presence[room, c], c))
        for _ in range(numbers[c])
    ]
    return BeliefGraph(graph, expectation.expected, presence, tuple(blind), mode, model)


def complete(hidden: Floats) -> npt.NDArray[np.int64]:
    """Return how many blind nodes of each class complete each room of `hidden` counts, `[R, C]`.

    A room gets its expected number of hidden objects, rounded (a half rounds up). They are
    distributed over the classes by largest remainder; ties go to the lower class index.
    """
    numbers = np.floor(hidden).astype(np.int64)
    missing = np.floor(hidden.sum(axis=1) + 0.5).astype(np.int64) - numbers.sum(axis=1)
    order = np.argsort(numbers - hidden, axis=1, kind="stable")  # largest remainder first
    rank = np.argsort(order, axis=1, kind="stable")
    return np.asarray(numbers + (rank < missing[:, None]))


def rank_unseen(expectation: Expectation, top: int) -> list[npt.NDArray[np.int64]]:
    """Return for every node at most `top` classes not seen there, the likeliest first.

    Ties go to the lower class index; a presence below `LEAST_PRESENCE` is left out.
    """
    ranked = []
    for inputs, presence in zip(expectation.inputs, expectation.presence, strict=True):
        belief = np.where(inputs > 0, 0.0, presence)
        order = np.argsort(-belief, kind="stable")[:top]
        ranked.append(order[belief[order] >= LEAST_PRESENCE])
    return ranked
