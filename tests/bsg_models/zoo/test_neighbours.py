"""Means of neighbours without a list of edges: by hand, and against PyG's over the edges."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import torch
from one_building import observe_building
from torch_geometric.nn import SAGEConv

from bsg_data.observation.observation import Observation, stack
from bsg_models.inputs.edges import EdgeSet, edges_of
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.neighbours import ListedNeighbours, Neighbours
from bsg_models.zoo.sage import CECISAGE, MeanConv, SAGEConfig

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


def test_means_by_hand() -> None:
    """A building of 10 with rooms of 1, 2 and 6."""
    seen = observe_building([[0]] * 4, connected=[(1, 2)])
    h = torch.tensor([[10.0], [1.0], [2.0], [6.0]])

    def mean(*edges: EdgeSet) -> list[float]:
        return Neighbours.of(seen, edges).mean(h)[:, 0].tolist()

    assert mean("complete") == [0.0, 4.0, 3.5, 1.5]
    assert mean("up") == [3.0, 0.0, 0.0, 0.0]
    assert mean("down") == [0.0, 10.0, 10.0, 10.0]
    assert mean("adjacent") == [0.0, 2.0, 1.0, 0.0]
    assert mean("down", "adjacent") == [0.0, 6.0, 5.5, 10.0]
    assert mean() == [0.0] * 4


@pytest.mark.parametrize("edges", EDGES)
def test_the_convolution_is_pygs_over_the_edges(edges: tuple[EdgeSet, ...]) -> None:
    seen = observe_several()
    torch.manual_seed(0)
    ours, h = MeanConv(6, 6), torch.randn(len(seen.inputs), 6)
    pygs = SAGEConv(6, 6)
    pygs.load_state_dict(ours.state_dict())
    listed = torch.from_numpy(edges_of(seen, edges))
    with torch.no_grad():
        torch.testing.assert_close(ours(h, Neighbours.of(seen, edges)), pygs(h, listed))
        assert torch.equal(ours(h, listed), pygs(h, listed))


@pytest.mark.parametrize("edges", EDGES)
def test_a_network_is_trained_with_pygs_gradients(edges: tuple[EdgeSet, ...]) -> None:
    """Sums in the same order: of a matrix, and of what the edges carry."""
    seen = observe_several()
    torch.manual_seed(0)
    ours, pygs = MeanConv(6, 6), SAGEConv(6, 6)
    pygs.load_state_dict(ours.state_dict())
    listed = torch.from_numpy(edges_of(seen, edges))
    h = torch.randn(len(seen.inputs), 6)
    found = []
    for convolution, neighbours in (
        (ours, ListedNeighbours.of(listed, nodes=len(h))),
        (pygs, listed),
    ):
        x = h.clone().requires_grad_()
        convolved = convolution(x, neighbours)
        convolved.square().sum().backward()
        assert x.grad is not None
        found.append((convolved.detach(), x.grad, convolution.lin_l.weight.grad))
    for one, other in zip(*found, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("edges", [("complete",), ("up", "down"), ("down", "adjacent")])
def test_a_network_is_asked_what_it_was_trained_on(edges: tuple[EdgeSet, ...]) -> None:
    seen = observe_several()
    torch.manual_seed(0)
    network = CECISAGE(SAGEConfig(width=8), ModelInputs(classes=1, edges=edges)).eval()
    for parameter in network.head.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    with torch.no_grad():
        asked, trained = network(network.nodes_of(seen)), network(network.graph_of(seen))
    torch.testing.assert_close(asked.mean, trained.mean)
    torch.testing.assert_close(asked.tilts, trained.tilts)


def test_many_rooms_take_no_edges() -> None:
    """Of 20,000 rooms that see each other a list would hold 400 million edges."""
    rooms = 20_000
    neighbours = Neighbours.of(observe_building(np.zeros((rooms + 1, 1)).tolist()), ("complete",))
    h = torch.arange(rooms + 1, dtype=torch.float32)[:, None]
    expected = (rooms * (rooms + 1) / 2 - h[1:, 0].double()) / (rooms - 1)
    torch.testing.assert_close(neighbours.mean(h)[1:, 0], expected.float())
