"""Measure what one belief takes beside the matrix products of its network in NumPy.

    python scripts/bench/belief.py

Ours: from a robot's graph to the presence of every class in every room, everything included.
Theirs: one product for every matrix of the network, with as many rows as the building has nodes.
With uncertain hidden shares, ours asks the network twice, about several copies of the building.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from robot import make_graph
from timing import Speed, print_speeds, time_both

from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import parse_robot_graph
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.found_model import find_model
from bsg_models.runs.predictor import Predictor
from bsg_models.runs.shipped import DEFAULT_MODEL

ROOMS, REPEATS, CALLS = (4, 8, 14), 20, 3


def measure() -> Iterator[Speed]:
    """Yield what a belief takes, of homes of several sizes."""
    predictor = Predictor()
    for rooms in ROOMS:
        graph = parse_robot_graph(make_graph(rooms), path=Path("made up"))
        products = multiply_by(list_matrices(), nodes=rooms + 1)
        for how, asked in (("certain", make_sure(graph)), ("uncertain", graph)):
            belief = partial(find_presence, predictor, asked)
            ours, theirs = time_both(repeat(belief), repeat(products), repeats=REPEATS)
            what = f"one belief, {rooms} rooms, hidden shares {how}"
            against = f"the matrix products of {DEFAULT_MODEL} in NumPy"
            yield Speed(what, against, ours / CALLS, theirs / CALLS, target=4)
            yield Speed(what, "", ours / CALLS, None, target=1e-3)


def find_presence(predictor: Predictor, graph: PartialGraph) -> np.ndarray:
    """Return what a model believes to be there, `[1 + R, C]`."""
    return predictor(graph).presence


def make_sure(graph: PartialGraph) -> PartialGraph:
    """Return a graph that is sure of its hidden shares."""
    return replace(graph, rooms=tuple(replace(room, hidden_share_sd=0.0) for room in graph.rooms))


def list_matrices() -> list[np.ndarray]:
    """Return the matrices of the network, `[in, out]`."""
    state = load_checkpoint(find_model(DEFAULT_MODEL).path).tensors
    return [
        np.ascontiguousarray(tensor.numpy().T.astype(np.float32))
        for name, tensor in state.items()
        if name.endswith("weight") and tensor.ndim == 2
    ]


def multiply_by(matrices: list[np.ndarray], *, nodes: int) -> Callable[[], object]:
    """Return what multiplies inputs of so many nodes by every matrix."""
    inputs = [np.ones((nodes, len(matrix)), dtype=np.float32) for matrix in matrices]
    return lambda: [one @ matrix for one, matrix in zip(inputs, matrices, strict=True)]


def repeat(call: Callable[[], object]) -> Callable[[], None]:
    """Return what calls several times: one call is too short to be timed."""

    def run() -> None:
        for _ in range(CALLS):
            call()

    return run


if __name__ == "__main__":
    print_speeds(measure())
