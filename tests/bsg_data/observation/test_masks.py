from __future__ import annotations

import doctest

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pytest_benchmark.fixture import BenchmarkFixture
from scipy import stats

from bsg_data.dataset.histograms import Counts, to_histograms
from bsg_data.errors import RecipeError
from bsg_data.observation import masks as masks_module
from bsg_data.observation.masks import (
    MASKS,
    UNVISITED_SHARE,
    Mask,
    sample_hidden,
    sample_visited,
    share_hidden,
)
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.connections import Connections

STRATEGIES = ("uniform", "rooms", "frontier")
cells_strategy = hnp.arrays(
    np.int64,
    st.tuples(st.integers(1, 6), st.integers(1, 5)),
    elements=st.integers(0, 9),
)
recipes = st.builds(
    MaskRecipe,
    strategy=st.sampled_from(STRATEGIES),
    fraction=st.integers(0, 100).map(lambda percent: percent / 100),
    seed=st.integers(0, 5),
)


def draw_mask(cells: Counts, recipe: MaskRecipe, draw: int = 0) -> tuple[Counts, Counts]:
    visited = sample_visited(cells, recipe, scene_id="s", draw=draw)
    return visited, sample_hidden(cells, visited, recipe, scene_id="s", draw=draw)


@given(cells_strategy, recipes, st.integers(0, 3))
def test_any_mask(cells: Counts, recipe: MaskRecipe, draw: int) -> None:
    visited, hidden = draw_mask(cells, recipe, draw)
    assert (hidden >= 0).all()
    assert (hidden <= cells).all()
    assert visited[0]
    assert (hidden[~visited] == cells[~visited]).all()
    low, high = MASKS[recipe.strategy].hidden_bounds(cells, recipe)
    assert low <= hidden.sum() <= high
    inputs = to_histograms(cells - hidden)
    assert (inputs[0] == (cells - hidden).sum(axis=0)).all()
    again = draw_mask(cells, recipe, draw)
    assert (again[0] == visited).all()
    assert (again[1] == hidden).all()


@given(cells_strategy, st.integers(0, 100))
def test_uniform_and_frontier_hide_exactly_the_floor(cells: Counts, percent: int) -> None:
    n = int(cells.sum())
    for strategy in ("uniform", "frontier"):
        recipe = MaskRecipe(strategy=strategy, fraction=percent / 100)
        assert draw_mask(cells, recipe)[1].sum() == percent * n // 100


@given(cells_strategy, st.integers(0, 100))
def test_rooms_hides_whole_rooms_and_no_more_than_needed(cells: Counts, percent: int) -> None:
    recipe = MaskRecipe(strategy="rooms", fraction=percent / 100)
    visited, hidden = draw_mask(cells, recipe)
    assert (hidden[1:][visited[1:]] == 0).all()
    largest = int(cells[1:].sum(axis=1).max(initial=0))
    needed = -(-percent * int(cells.sum()) // 100)
    assert hidden.sum() < needed + max(largest, 1)
    assert hidden[0].sum() == -(-percent * int(cells[0].sum()) // 100)
    assert hidden.sum() * 100 >= percent * cells.sum()


def test_one_cell_follows_the_hypergeometric_distribution() -> None:
    """A marginal of the mask against SciPy, by a chi-square test over 4,000 draws."""
    cells = np.array([[2, 1], [6, 3], [4, 4]])
    recipe = MaskRecipe(fraction=0.5, seed=7)
    seen = np.array([draw_mask(cells, recipe, draw)[1][1, 0] for draw in range(4000)])
    distribution = stats.hypergeom(M=20, n=6, N=10)
    expected = 4000 * distribution.pmf(np.arange(7))
    assert stats.chisquare(np.bincount(seen, minlength=7), expected).pvalue > 1e-3


def test_the_fraction_is_exact_in_decimals() -> None:
    cells = np.array([[0], [100]])
    assert draw_mask(cells, MaskRecipe(fraction=0.29))[1].sum() == 29  # 0.29 * 100 is 28.99…


def test_nothing_and_everything() -> None:
    cells = np.array([[1, 0], [3, 2], [0, 5]])
    for strategy in STRATEGIES:
        assert draw_mask(cells, MaskRecipe(strategy=strategy, fraction=0.0))[1].sum() == 0
        assert (draw_mask(cells, MaskRecipe(strategy=strategy, fraction=1.0))[1] == cells).all()


def test_a_draw_depends_on_seed_scene_and_draw_and_on_nothing_else() -> None:
    cells = np.full((4, 6), 9)
    every = {
        sample_hidden(
            cells,
            np.ones(4, dtype=bool),
            MaskRecipe(seed=seed),
            scene_id=scene,
            draw=draw,
            stream=stream,
        ).tobytes()
        for seed in (0, 1)
        for scene in ("a", "b")
        for draw in (0, 1)
        for stream in ("classified", "unclassified")
    }
    assert len(every) == 16


def test_the_stream_of_a_recipe_never_changes() -> None:
    """Drawn once by hand and written down: pairs made yesterday are the recipe's tomorrow."""
    cells = np.arange(12).reshape(4, 3)
    recipe = MaskRecipe(seed=5)
    visited = sample_visited(cells, recipe, scene_id="00006-HkseAnWCgqk", draw=2)
    hidden = sample_hidden(cells, visited, recipe, scene_id="00006-HkseAnWCgqk", draw=2)
    assert hidden.tolist() == [[0, 1, 0], [3, 2, 2], [2, 2, 3], [4, 7, 7]]
    rooms = [
        sample_visited(cells, MaskRecipe(strategy="rooms"), scene_id="s", draw=draw).tolist()
        for draw in range(3)
    ]
    assert rooms == [
        [True, False, True, False],
        [True, True, False, False],
        [True, True, False, False],
    ]


def test_every_room_is_left_out_by_some_draw() -> None:
    cells = np.full((6, 2), 5)
    for strategy in ("rooms", "frontier"):
        recipe = MaskRecipe(strategy=strategy)
        drawn = np.stack([sample_visited(cells, recipe, scene_id="s", draw=d) for d in range(60)])
        assert (~drawn[:, 1:]).any(axis=0).all()
        assert drawn[:, 1:].any(axis=0).all()
        assert len({row.tobytes() for row in drawn}) >= 5


def test_frontier_leaves_rooms_out() -> None:
    cells = np.full((9, 2), 5)
    visited = sample_visited(cells, MaskRecipe(strategy="frontier"), scene_id="s", draw=0)
    hidden_there = cells[~visited].sum()
    assert 0 < hidden_there <= UNVISITED_SHARE * (cells.sum() // 2)


def test_objects_without_a_class_are_hidden_by_the_same_rule() -> None:
    classified = np.array([[0, 0], [5, 5], [5, 5], [5, 5], [5, 5]])
    others = np.array([[2], [10], [0], [7], [1]])
    for strategy in STRATEGIES:
        recipe = MaskRecipe(strategy=strategy)
        visited = sample_visited(classified, recipe, scene_id="s", draw=0)
        hidden = sample_hidden(others, visited, recipe, scene_id="s", draw=0, stream="unclassified")
        assert (hidden[~visited] == others[~visited]).all()
        if strategy == "uniform":
            assert hidden.sum() == 10


@pytest.mark.parametrize("draw", range(20))
def test_frontier_visits_a_connected_set_over_the_adjacency(draw: int) -> None:
    cells = np.full((9, 2), 5)
    cells[0] = 0
    adjacent = [(i, i + 1) for i in range(1, 8)]
    recipe, known = MaskRecipe(strategy="frontier"), Connections.of_pairs(adjacent)
    visited = sample_visited(cells, recipe, scene_id="s", draw=draw, connections=known)
    rooms = np.flatnonzero(visited[1:]) + 1
    assert nx.is_connected(nx.Graph(adjacent).subgraph(rooms.tolist()))
    assert cells[~visited].sum() <= 0.25 * cells.sum() + 1e-9
    hidden = sample_hidden(cells, visited, recipe, scene_id="s", draw=draw)
    assert hidden[visited].sum() > 0  # visited rooms lose a share too


def test_frontier_leaves_an_exhausted_part() -> None:
    cells = np.array([[0], [10], [10], [10], [10]])
    recipe = MaskRecipe(strategy="frontier", fraction=0.2)
    parts = Connections.of_pairs([(1, 2), (3, 4)])
    for draw in range(10):
        visited = sample_visited(cells, recipe, scene_id="s", draw=draw, connections=parts)
        assert cells[~visited].sum() <= 4


def test_doctests() -> None:
    assert doctest.testmod(masks_module).attempted == 1
    assert doctest.testmod(masks_module).failed == 0


def test_every_strategy_is_a_row_of_the_registry() -> None:
    assert MASKS.names()[:3] == STRATEGIES
    rows = [MASKS[name] for name in STRATEGIES]
    assert all(isinstance(row, Mask) and row.summary for row in rows)
    assert [row.reads_connections for row in rows] == [False, False, True]


def test_a_strategy_that_nobody_knows_is_refused_with_the_nearest() -> None:
    cells, recipe = np.array([[0], [5]]), MaskRecipe(strategy="room")
    with pytest.raises(RecipeError, match=r"no mask 'room'; did you mean rooms\?"):
        sample_visited(cells, recipe, scene_id="s", draw=0)
    with pytest.raises(RecipeError, match="no mask 'room'"):
        sample_hidden(cells, np.ones(2, dtype=bool), recipe, scene_id="s", draw=0)
    with pytest.raises(RecipeError, match="no mask 'room'"):
        share_hidden(np.ones(2, dtype=bool), recipe)


def test_what_is_thinned_and_the_bounds_by_hand() -> None:
    """Ten objects in the null region, 6 and 4 in two rooms; the second room is not visited."""
    cells, visited = np.array([[7, 3], [6, 0], [1, 3]]), np.array([True, True, False])
    for strategy, thinned, number, bounds in (
        ("uniform", visited, 10 - 4, (10, 10)),  # half of twenty, less what the room takes
        ("frontier", visited, 10 - 4, (10, 10)),
        ("rooms", np.array([True, False, False]), 5, (10, 15)),  # a room of six more at most
    ):
        recipe = MaskRecipe(strategy=strategy)
        found, lost = MASKS[strategy].thin(cells, visited, recipe)
        assert (found.tolist(), lost) == (thinned.tolist(), number), strategy
        assert MASKS[strategy].hidden_bounds(cells, recipe) == bounds, strategy
        hidden = sample_hidden(cells, visited, recipe, scene_id="s", draw=0)
        assert hidden[2].tolist() == [1, 3]
        assert hidden[~visited].sum() + number == hidden.sum()


def test_shares_by_hand() -> None:
    visited = np.array([True, True, False])
    for strategy, of_visited in (("uniform", 0.5), ("rooms", 0.0), ("frontier", 1 / 3)):
        found = share_hidden(visited, MaskRecipe(strategy=strategy))
        assert found.tolist() == pytest.approx([0.5, of_visited, 1.0])


def test_no_connections_and_unknown_ones_are_the_same() -> None:
    cells = np.full((6, 2), 5)
    recipe = MaskRecipe(strategy="frontier")
    for draw in range(10):
        silent = sample_visited(cells, recipe, scene_id="s", draw=draw)
        empty = sample_visited(
            cells, recipe, scene_id="s", draw=draw, connections=Connections.of_pairs(())
        )
        assert silent.tolist() == empty.tolist()


def hide_one_by_one(cells: Counts, number: int, rng: np.random.Generator) -> Counts:
    """Delete single objects, as the paper words it: what the vectorised draw is compared with."""
    objects = [
        (room, kind)
        for room, row in enumerate(cells.tolist())
        for kind, count in enumerate(row)
        for _ in range(count)
    ]
    hidden = np.zeros_like(cells)
    for _ in range(number):
        room, kind = objects.pop(int(rng.integers(len(objects))))
        hidden[room, kind] += 1
    return hidden


@pytest.mark.parametrize("how", ["vectorised", "one by one"])
@pytest.mark.benchmark(group="one draw of a building with 16 rooms and about 500 objects")
def test_bench_a_draw(benchmark: BenchmarkFixture, how: str) -> None:
    rng = np.random.default_rng(0)
    cells = rng.poisson(0.7, (17, 45))
    visited, recipe = np.ones(17, dtype=bool), MaskRecipe()
    if how == "vectorised":
        hidden = benchmark(sample_hidden, cells, visited, recipe, scene_id="s", draw=0)
    else:
        hidden = benchmark(hide_one_by_one, cells, int(cells.sum()) // 2, rng)
    assert hidden.sum() == cells.sum() // 2
