from __future__ import annotations

from collections.abc import Iterator

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import stats

from bsg_data.arrays import Counts
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import MASKS, sample_view
from bsg_data.observation.view import View, sample_hidden, sample_unknown
from bsg_data.recipes import Exploration, MaskRecipe
from bsg_data.scene.connections import Connections

STRATEGIES = ("uniform", "rooms", "frontier", "explore", "search", "tour", "mixed")
FRACTIONS = (0.1, 0.3, 0.5, 0.7, 0.9)
ROW = Connections.of_pairs([(room, room + 1) for room in range(1, 12)])
cells_strategy = hnp.arrays(
    np.int64,
    st.tuples(st.integers(1, 6), st.integers(1, 5)),
    elements=st.integers(0, 9),
)
ranges = st.lists(st.integers(0, 10), min_size=2, max_size=2).map(
    lambda ends: (min(ends) / 10, max(ends) / 10)
)
explorations = st.builds(
    Exploration,
    not_entered=ranges,
    searched=ranges,
    glimpsed=st.sampled_from([0.0, 0.5, 1.0]),
    glimpsed_share=ranges,
    spread=st.sampled_from([0.0, 0.8, 0.99]),
    connected=st.booleans(),
    exact=st.booleans(),
)
recipes = st.builds(
    MaskRecipe,
    strategy=st.sampled_from(STRATEGIES),
    fraction=st.integers(0, 100).map(lambda percent: percent / 100),
    seed=st.integers(0, 5),
    withhold=st.sampled_from([0.0, 0.3]),
    exploration=explorations,
)


def draw_mask(
    cells: Counts, recipe: MaskRecipe, draw: int = 0, connections: Connections | None = None
) -> tuple[View, Counts]:
    view = sample_view(cells.shape, recipe, scene_id="s", draw=draw, connections=connections)
    return view, sample_hidden(view.cut(cells), view, recipe, scene_id="s", draw=draw)


def draw_views(recipe: MaskRecipe, rooms: int, draws: int = 300) -> Iterator[View]:
    connections = Connections.of_pairs([(room, room + 1) for room in range(1, rooms)])
    for draw in range(draws):
        yield sample_view((rooms + 1, 1), recipe, scene_id="s", draw=draw, connections=connections)


@given(cells_strategy, recipes, st.integers(0, 3), st.booleans())
def test_any_exploration_hides_what_its_view_says(
    cells: Counts, recipe: MaskRecipe, draw: int, connect: bool
) -> None:
    row = Connections.of_pairs([(room, room + 1) for room in range(1, len(cells) - 1)])
    view, hidden = draw_mask(cells, recipe, draw, row if connect else None)
    found = view.cut(cells)
    assert ((hidden >= 0) & (hidden <= found)).all()
    assert ((view.hidden_share >= 0) & (view.hidden_share <= 1)).all()
    everything = (view.hidden_share == 1)[:, None] | view.withheld
    assert (hidden == found)[everything].all()
    assert (hidden[(view.hidden_share == 0)[:, None] & ~view.withheld] == 0).all()
    assert not view.withheld[view.hidden_share == 0].any()


@given(cells_strategy, st.integers(0, 100))
def test_uniform_hides_exactly_the_floor(cells: Counts, percent: int) -> None:
    recipe = MaskRecipe(strategy="uniform", fraction=percent / 100)
    view, hidden = draw_mask(cells, recipe)
    assert hidden.sum() == percent * int(cells.sum()) // 100
    assert view.visited.all()
    assert set(view.hidden_share.tolist()) == {percent / 100}


@given(st.integers(2, 9), st.integers(0, 100), st.integers(0, 5))
def test_rooms_leaves_out_that_share_of_the_rooms(nodes: int, percent: int, draw: int) -> None:
    cells = np.full((nodes, 2), 5)
    cells[0] = 0
    view, hidden = draw_mask(cells, MaskRecipe(strategy="rooms", fraction=percent / 100), draw)
    left_out = int((~view.visited).sum())
    wanted = percent * (nodes - 1) / 100
    assert np.floor(wanted) <= left_out <= np.ceil(wanted)
    assert view.hidden_share[1:].tolist() == (~view.visited[1:]).astype(float).tolist()
    assert view.hidden_share[0] == pytest.approx(left_out / (nodes - 1))
    assert hidden.sum() == left_out * 10


def test_one_cell_follows_the_hypergeometric_distribution() -> None:
    """A marginal of the paper's mask against SciPy, by a chi-square test over 4,000 draws."""
    cells = np.array([[2, 1], [6, 3], [4, 4]])
    recipe = MaskRecipe(fraction=0.5, seed=7)
    seen = np.array([draw_mask(cells, recipe, draw)[1][1, 0] for draw in range(4000)])
    distribution = stats.hypergeom(M=20, n=6, N=10)
    expected = 4000 * distribution.pmf(np.arange(7))
    assert stats.chisquare(np.bincount(seen, minlength=7), expected).pvalue > 1e-3


def test_the_stream_of_a_recipe_never_changes() -> None:
    """Drawn once by hand and written down: pairs made yesterday are the recipe's tomorrow."""
    cells = np.arange(12).reshape(4, 3)
    recipe, scene = MaskRecipe(seed=5), "00006-HkseAnWCgqk"
    view = sample_view(cells.shape, recipe, scene_id=scene, draw=2)
    hidden = sample_hidden(cells, view, recipe, scene_id=scene, draw=2)
    assert hidden.tolist() == [[0, 1, 0], [3, 2, 2], [2, 2, 3], [4, 7, 7]]
    recipe = MaskRecipe(strategy="explore", withhold=0.4)
    row = Connections.of_pairs([(1, 2), (2, 3), (3, 4)])
    view = sample_view((5, 3), recipe, scene_id="s", draw=1, connections=row)
    assert view.visited.tolist() == EXPLORED[0]
    assert view.hidden_share.round(4).tolist() == EXPLORED[1]
    assert view.withheld[0].tolist() == EXPLORED[2]
    hidden = sample_hidden(np.full((5, 3), 6), view, recipe, scene_id="s", draw=1)
    assert hidden.tolist() == EXPLORED[3]


EXPLORED: tuple[list[object], ...] = (
    [True, True, True, True, True],
    [0.3503, 0.4194, 0.5266, 0.4553, 0.0],
    [True, False, False],
    [[6, 0, 2], [6, 2, 2], [6, 2, 1], [6, 3, 3], [0, 0, 0]],
)


@pytest.mark.parametrize("rooms", [1, 2, 9])
@pytest.mark.parametrize("exploration", [None, (0.3, 0.9), (1.0, 1.0)])
def test_explore_hides_the_fraction_in_the_mean(
    rooms: int, exploration: tuple[float, float] | None
) -> None:
    """Whatever the values of the exploration, and in the smallest buildings, too."""
    chosen = Exploration()
    if exploration is not None:
        chosen = Exploration(not_entered=exploration, searched=exploration, glimpsed=1.0)
    for fraction in FRACTIONS:
        recipe = MaskRecipe(strategy="explore", fraction=fraction, exploration=chosen)
        shares = np.array([view.hidden_share[0] for view in draw_views(recipe, rooms, 200)])
        assert abs(shares.mean() - fraction) < 4 * shares.std() / np.sqrt(200) + 1e-6


def test_explore_has_rooms_of_all_four_kinds() -> None:
    recipe = MaskRecipe(strategy="explore")
    kinds = dict.fromkeys(("searched", "half seen", "glimpsed", "not entered"), 0)
    for view in draw_views(recipe, 12):
        share, inside = view.hidden_share[1:], view.visited[1:]
        assert inside.any(), "the robot is in some room"
        kinds["searched"] += int((inside & (share == 0)).sum())
        kinds["half seen"] += int((inside & (share > 0)).sum())
        kinds["glimpsed"] += int((~inside & (share < 1)).sum())
        kinds["not entered"] += int((~inside & (share == 1)).sum())
        beside = np.convolve(inside, [1, 0, 1], mode="same") > 0
        glimpsed = ~inside & (share < 1)
        assert beside[glimpsed].all(), "seen from a room that was entered"
        assert ((share[glimpsed] >= 0.7) & (share[glimpsed] <= 0.98)).all()
        half = share[inside & (share > 0)]
        assert len(set(half.tolist())) == len(half), "each has a share of its own"
    assert min(kinds.values()) > 0.03 * sum(kinds.values()), kinds


def test_the_robot_enters_rooms_over_connections() -> None:
    for strategy in ("explore", "frontier"):
        for view in draw_views(MaskRecipe(strategy=strategy), 12, 60):
            rooms = np.flatnonzero(view.visited[1:]) + 1
            assert nx.is_connected(nx.path_graph(range(1, 13)).subgraph(rooms.tolist()))


def test_every_number_of_rooms_up_to_half_is_searched() -> None:
    views = list(draw_views(MaskRecipe(strategy="search"), 7))
    numbers = np.bincount([int((view.hidden_share[1:] == 0).sum()) for view in views], minlength=4)
    assert (numbers > 40).all()
    assert len(numbers) == 4


def test_mixed_is_each_of_the_others_as_often() -> None:
    """Over 1,000 draws, against the look of the mask that the generator chooses; by chi-square.

    Six in ten are tours of one room to all, with the logarithm of their number uniform.
    """
    recipe, numbers = MaskRecipe(strategy="mixed", fraction=0.4, seed=2), np.zeros(5)
    found = np.zeros(10)
    connections = ROW.take(slice(0, 8))
    for draw in range(1000):
        view = sample_view((10, 2), recipe, scene_id="s", draw=draw, connections=connections)
        (rng,) = MaskStreams([recipe], ["s"], [draw]).of("rooms")
        if rng.random() < 0.6:
            found[len(view.nodes) - 1] += 1
            continue
        number = int(rng.integers(5))
        one = MASKS[STRATEGIES[number]].look((10, 2), recipe, connections=connections, rng=rng)
        assert view.agrees(one)
        assert view.exact == (STRATEGIES[number] == "uniform")
        numbers[number] += 1
    assert stats.chisquare(numbers).pvalue > 1e-3
    assert stats.binomtest(int(found.sum()), 1000, 0.6).pvalue > 1e-3
    assert stats.chisquare(found[1:], found.sum() * np.diff(np.log10(range(1, 11)))).pvalue > 1e-3


def test_a_tour_finds_rooms_over_connections() -> None:
    """The share of the rooms that it says, or their number; all of a smaller building."""
    graph = nx.path_graph(range(1, 13))
    kinds = set()
    for fraction, number in ((0.0, 1), (0.3, 4), (0.5, 6), (0.9, 11), (1.0, 12)):
        for view in draw_views(MaskRecipe(strategy="tour", fraction=fraction), 12, 40):
            rooms = view.nodes[1:].tolist()
            assert len(rooms) == number
            assert nx.is_connected(graph.subgraph(rooms))
            shows = (view.hidden_share[1:] < 1).tolist()
            kinds |= set(zip(view.visited[1:].tolist(), shows, strict=True))
    assert kinds == {(True, True), (False, False), (False, True)}, "entered, not, glimpsed"
    for number in (1, 5, 12, 30):
        (view,) = draw_views(MaskRecipe(strategy="tour", rooms=number), 12, 1)
        assert len(view.nodes) == 1 + min(number, 12)


def test_a_tour_without_connections_goes_to_rooms_that_are_near_in_the_list() -> None:
    for draw in range(60):
        view = sample_view((41, 1), MaskRecipe(strategy="tour", rooms=6), scene_id="s", draw=draw)
        assert (np.diff(view.nodes[1:]) <= 2).all()


def test_objects_in_no_room_are_in_no_graph_of_a_part() -> None:
    cells = np.full((5, 2), 3)
    part, whole = (
        sample_view(cells.shape, MaskRecipe(strategy="tour", rooms=rooms), scene_id="s", draw=0)
        for rooms in (2, 4)
    )
    assert part.cut(cells).tolist() == [[0, 0], [3, 3], [3, 3]]
    assert whole.cut(cells).tolist() == cells.tolist()
    assert part.in_building(5).hidden_share[[n for n in range(1, 5) if n not in part.nodes]].all()
    entered = np.isin(np.arange(5), part.nodes[part.visited])
    assert part.in_building(5).visited.tolist() == entered.tolist()


def test_a_detector_that_knows_few_words_shows_no_other_class_in_any_room() -> None:
    recipe = MaskRecipe(strategy="explore", detector=0.5)
    plain = recipe.model_copy(update={"detector": 0.0})
    shares = []
    for draw in range(400):
        view = sample_view((5, 45), recipe, scene_id="s", draw=draw)
        (rng,) = MaskStreams([recipe], ["s"], [draw]).of("detector")
        unknown, _ = sample_unknown(rng, recipe, classes=45)
        assert (view.withheld == unknown).all()
        shares.append(unknown.mean())
        other = sample_view((5, 45), plain, scene_id="s", draw=draw)
        assert np.array_equal(view.hidden_share, other.hidden_share)
    limited = np.array(shares) > 0
    assert 0.4 < limited.mean() < 0.6  # six standard deviations are .15
    assert 0.4 < np.array(shares)[limited].mean() < 0.6  # any share, equally likely
