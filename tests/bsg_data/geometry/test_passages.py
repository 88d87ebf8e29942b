"""The rule for boxes: shares of spanning forests by counting them, and what must not matter."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import networkx as nx
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.geometry.passages import _share_of_forests, choose_pairs, score_pairs
from bsg_data.sources.layout_files import read_layout

Floats = npt.NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)


def shares_by_counting(pairs: list[tuple[int, int]], weight: Floats, rooms: int) -> Floats:
    """List every way to give each room a parent or none, keep those without a circle."""
    total, having = 0.0, np.zeros(len(pairs))
    ways: list[list[tuple[int, int, int, int] | None]] = [[None] for _ in range(rooms)]
    for number, (a, b) in enumerate(pairs):
        ways[a].append((a, b, 0, number))
        ways[b].append((b, a, 1, number))
    for chosen in product(*ways):
        edges = [edge for edge in chosen if edge is not None]
        if not edges or nx.is_directed_acyclic_graph(nx.DiGraph(edge[:2] for edge in edges)):
            share = float(np.prod([weight[way, number] for _, _, way, number in edges]))
            total += share
            having[[number for *_, number in edges]] += share
    return having / total


@settings(max_examples=25, deadline=None)
@given(seed=seeds, rooms=st.integers(2, 5))
def test_the_inverse_gives_what_counting_forests_gives(seed: int, rooms: int) -> None:
    rng = np.random.default_rng(seed)
    pairs = [(a, b) for a in range(rooms) for b in range(a + 1, rooms) if rng.random() < 0.7]
    log_weight = rng.normal(0, 1, (2, len(pairs)))
    numbers = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    found = _share_of_forests(numbers, log_weight, rooms=rooms)
    np.testing.assert_allclose(found, shares_by_counting(pairs, np.exp(log_weight), rooms))


def draw_boxes(seed: int, rooms: int) -> Floats:
    rng = np.random.default_rng(seed)
    low = np.round(rng.uniform(0, 8, (rooms, 3)) * (1, 1, 0.5), 1)
    return np.stack([low, low + rng.uniform(0.5, 5, (rooms, 3))], axis=1)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, rooms=st.integers(0, 12), turns=st.integers(1, 3), mirror=st.booleans())
def test_turning_mirroring_moving_and_reordering_change_nothing(
    seed: int, rooms: int, turns: int, mirror: bool
) -> None:
    boxes = draw_boxes(seed, rooms)
    pairs, belief = score_pairs(boxes)
    moved = boxes.copy()
    for _ in range(turns):  # a quarter turn: (x, y) to (-y, x)
        x, y, z = np.moveaxis(moved, -1, 0)
        moved = np.sort(np.stack([-y, x, z], axis=-1), axis=1)
    if mirror:
        moved = np.sort(moved * (-1, 1, 1), axis=1)
    order = np.random.default_rng(seed).permutation(rooms)
    there_pairs, there = score_pairs((moved + np.array([3, -7, 2]))[order])
    named = {
        tuple(sorted(order[list(pair)])): value
        for pair, value in zip(there_pairs, there, strict=True)
    }
    here = {tuple(pair): value for pair, value in zip(pairs.tolist(), belief, strict=True)}
    assert set(named) == set(here)
    for pair, value in here.items():
        assert named[pair] == pytest.approx(value, abs=1e-9)


def find_passages(boxes: Floats) -> list[tuple[int, int]]:
    pairs, probability = score_pairs(boxes)
    kept = choose_pairs(pairs, probability, rooms=len(boxes))
    return sorted((int(a), int(b)) for a, b in pairs[kept])


def test_what_is_known_is_kept_and_joins() -> None:
    pairs = np.array([[0, 1], [0, 2], [1, 2]])
    belief = np.array([0.05, 0.3, 0.25])
    kept = choose_pairs(pairs, belief, rooms=3, known={(0, 1)}, threshold=0.5)
    assert kept.tolist() == [True, True, False]  # 1-2 would join what is joined already


def test_real_layouts_are_found_as_well_as_in_the_docs(shared: Path) -> None:
    right = found = true = 0
    for path in sorted((shared / "room_layouts").glob("*.yaml")):
        layout = read_layout(path)
        numbers = sorted(layout.rooms)
        found_boxes = (layout.rooms[number].box for number in numbers)
        boxes = np.array([[b.minimum, b.maximum] for b in found_boxes if b is not None])
        pairs = {(numbers[a], numbers[b]) for a, b in find_passages(boxes)}
        right += len(pairs & set(layout.connections))
        found, true = found + len(pairs), true + len(layout.connections)
    assert true == 688
    assert 2 * right / (found + true) == pytest.approx(0.772, abs=0.001)  # in sample
