"""Edges and neighbours by hand, by brute force, and against PyG's sums over the edges."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from one_building import observe_building, surround_rooms
from torch_geometric.nn import SAGEConv

from bsg_data.observation.observation import Observation, stack
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES
from bsg_data.scene.surroundings import EVIDENCE as EVIDENCE_OF_DATA
from bsg_models.inputs.nodes import EVIDENCE, Neighbours, list_edges, to_nodes
from bsg_models.zoo.networks import convolve
from bsg_models.zoo.settings import EdgeSet

KINDS: tuple[EdgeSet, ...] = ("up", "down", "adjacent", "complete")
EDGES = [some for size in range(5) for some in combinations(KINDS, size)]


def observe_several() -> Observation:
    """Return three buildings of 3, 0 and 5 rooms."""
    return stack(
        [
            observe_building([[6], [1], [2], [3]], connected=[(1, 2), (2, 3)]),
            observe_building([[4]]),
            observe_building([[9], [1], [1], [2], [2], [3]], connected=[(1, 5), (2, 4)]),
        ]
    )


@given(
    sizes=st.lists(st.integers(1, 6), min_size=1, max_size=4), edges=st.sets(st.sampled_from(KINDS))
)
def test_edges_are_those_of_a_naive_loop(sizes: list[int], edges: set[EdgeSet]) -> None:
    parts = [
        observe_building([[0]] * nodes, connected=[(1, nodes - 1)] if nodes > 2 else [])
        for nodes in sizes
    ]
    seen, expected = stack(parts), []
    for first, nodes in zip(seen.starts.tolist(), sizes, strict=False):
        for a in range(nodes):
            for b in range(nodes):
                rooms = a > 0 and b > 0 and a != b
                kinds = {"complete"} if rooms else set()
                kinds |= {"adjacent"} if rooms and {a, b} == {1, nodes - 1} else set()
                kinds |= {"up"} if a > 0 == b else set()
                kinds |= {"down"} if b > 0 == a else set()
                if kinds & edges:
                    expected.append([first + a, first + b])
    assert list_edges(seen, tuple(edges)).T.tolist() == expected


@pytest.mark.parametrize("edges", EDGES)
def test_the_convolution_and_its_gradients_are_pygs_over_the_edges(
    edges: tuple[EdgeSet, ...],
) -> None:
    """PyG's mean over the edges and four more to each node, from a last one of zeros."""
    seen = observe_several()
    torch.manual_seed(0)
    pygs = SAGEConv(6, 6)
    ours = {f"one.{name}": value for name, value in pygs.named_parameters()}
    number = len(seen.inputs)
    zeros = torch.stack([torch.full((4 * number,), number), torch.arange(number).repeat(4)])
    listed = torch.cat([torch.from_numpy(list_edges(seen, edges)), zeros], dim=1)
    h = torch.randn(number, 6)
    found = []
    neighbours = Neighbours.of(seen, edges)
    for is_ours in (True, False):
        x = h.clone().requires_grad_()
        pygs.zero_grad()
        if is_ours:
            convolved = convolve(ours, "one", x, neighbours.to(torch.device("cpu")))
        else:
            convolved = pygs(torch.cat([x, torch.zeros(1, 6)]), listed)[:number]
        convolved.square().sum().backward()
        found.append((convolved.detach(), x.grad, pygs.lin_l.weight.grad.clone()))
    for one, other in zip(*found, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-5, atol=1e-6)
    weights = {name: value.detach().numpy() for name, value in ours.items()}
    answered = convolve(weights, "one", h.numpy(), neighbours)
    np.testing.assert_allclose(answered, found[0][0], rtol=1e-5, atol=1e-6)


def test_many_rooms_take_no_edges() -> None:
    """Of 20,000 rooms that see each other a list would hold 400 million edges."""
    rooms = 20_000
    neighbours = Neighbours.of(observe_building(np.zeros((rooms + 1, 1)).tolist()), ("complete",))
    h = np.arange(rooms + 1, dtype=np.float32)[:, None]
    expected = (rooms * (rooms + 1) / 2 - h[1:, 0].astype(float)) / (rooms + 3)
    np.testing.assert_allclose(neighbours.mean(h)[1:, 0], expected, rtol=1e-6)


def test_evidence_by_hand() -> None:
    """Two rooms: one of 12 e m² and known kind, one of which nothing is known; then a building."""
    around = surround_rooms(
        [12 * math.e, None], ["kitchen", None], building_kind="office", source="behavior"
    )
    known = replace(observe_building([[1.0], [1.0], [0.0]]), surroundings=around)
    nodes = to_nodes(stack([known, observe_building([[0.0]])]), reads=EVIDENCE)
    assert {name: values.shape for name, values in nodes.evidence.items()} == {
        name: (4, kind.width()) for name, kind in EVIDENCE.items()
    }
    size = nodes.evidence["size"].tolist()
    assert size == [[0, 0], [pytest.approx(1.0, abs=1e-6), 1], [0, 0], [0, 0]]
    kitchen = list_room_labels().index("kitchen")
    assert np.argwhere(nodes.evidence["labels"]).tolist() == [[1, kitchen]]
    for name, names, word in (
        ("kind", BUILDING_KINDS, "office"),
        ("source", KNOWN_SOURCES, "behavior"),
    ):
        column = names.index(word) - 1  # the first is marked like an unknown one
        assert np.argwhere(nodes.evidence[name]).tolist() == [[row, column] for row in range(3)]


def test_every_kind_of_evidence_has_one_encoding() -> None:
    """A new kind is a field of a room, a row of its values and a row here: nothing else loops."""
    around = surround_rooms([9.0], ["kitchen"], building_kind="shop", source="mp3d")
    seen = observe_building([[1.0], [1.0]], surroundings=around)
    whole = to_nodes(seen, reads=EVIDENCE).evidence
    hidden = []
    for kind in EVIDENCE_OF_DATA:
        less = to_nodes(seen.without(kind), reads=EVIDENCE).evidence
        hidden += [name for name in EVIDENCE if not np.array_equal(less[name], whole[name])]
    assert hidden == list(EVIDENCE)
