"""What each mask alone promises; what all promise is `bsg_data.testing.MaskContract`."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import stats

from bsg_data.arrays import Counts, Ints
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.view import View, sample_unknown
from bsg_data.recipes import Exploration, MaskRecipe
from bsg_data.scene.connections import Connections
from bsg_data.testing import draw_mask, require_sound

STRATEGIES = ("uniform", "rooms", "frontier", "explore", "search", "tour", "mixed")
cells_strategy = hnp.arrays(
    np.int64, st.tuples(st.integers(1, 6), st.integers(1, 5)), elements=st.integers(0, 9)
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


def connect_row(rooms: int) -> Connections:
    return Connections.of_pairs([(room, room + 1) for room in range(1, rooms)])


def draw_views(
    recipe: MaskRecipe, rooms: int, draws: int = 300, *, connect: bool = True
) -> Iterator[View]:
    row, cells = connect_row(rooms if connect else 0), np.zeros((rooms + 1, 1), dtype=np.int64)
    for draw in range(draws):
        yield draw_mask(cells, recipe, draw=draw, connections=row)[0]


def require_connected(rooms: Ints) -> None:
    """Refuse rooms of a row that are none, or not one beside the other."""
    assert (np.diff(rooms) == 1).all()
    assert len(rooms)


@given(cells_strategy, recipes, st.integers(0, 3), st.booleans())
def test_any_exploration_hides_what_its_view_says(
    cells: Counts, recipe: MaskRecipe, draw: int, connect: bool
) -> None:
    row = connect_row(len(cells) - 1 if connect else 0)
    view, found, hidden = draw_mask(cells, recipe, draw=draw, connections=row)
    require_sound(view, found, hidden)
    assert not view.withheld[view.hidden_share == 0].any()


@given(cells_strategy, st.integers(0, 100))
def test_uniform_hides_exactly_the_floor(cells: Counts, percent: int) -> None:
    view, _, hidden = draw_mask(cells, MaskRecipe(strategy="uniform", fraction=percent / 100))
    assert hidden.sum() == percent * int(cells.sum()) // 100
    assert view.visited.all()
    assert set(view.hidden_share.tolist()) == {percent / 100}


@given(st.integers(2, 9), st.integers(0, 100), st.integers(0, 5))
def test_rooms_leaves_out_that_share_of_the_rooms(nodes: int, percent: int, draw: int) -> None:
    cells = np.full((nodes, 2), 5)
    cells[0] = 0
    recipe = MaskRecipe(strategy="rooms", fraction=percent / 100)
    view, _, hidden = draw_mask(cells, recipe, draw=draw)
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
    seen = np.array([draw_mask(cells, recipe, draw=draw)[2][1, 0] for draw in range(4000)])
    expected = 4000 * stats.hypergeom(M=20, n=6, N=10).pmf(np.arange(7))
    assert stats.chisquare(np.bincount(seen, minlength=7), expected).pvalue > 1e-3


def test_the_stream_of_a_recipe_never_changes() -> None:
    """Drawn once by hand and written down: pairs made yesterday are the recipe's tomorrow."""
    cells = np.arange(12).reshape(4, 3)
    _, _, hidden = draw_mask(cells, MaskRecipe(seed=5), scene_id="00006-HkseAnWCgqk", draw=2)
    assert hidden.tolist() == [[0, 1, 0], [3, 2, 2], [2, 2, 3], [4, 7, 7]]
    recipe = MaskRecipe(strategy="explore", withhold=0.4)
    view, _, hidden = draw_mask(np.full((5, 3), 6), recipe, draw=1, connections=connect_row(4))
    assert view.visited.tolist() == [True, True, True, True, True]
    assert view.hidden_share.round(4).tolist() == [0.3503, 0.4194, 0.5266, 0.4553, 0.0]
    assert view.withheld[0].tolist() == [True, False, False]
    assert hidden.tolist() == [[6, 0, 2], [6, 2, 2], [6, 2, 1], [6, 3, 3], [0, 0, 0]]


@pytest.mark.parametrize("rooms", [1, 2, 9])
@pytest.mark.parametrize("share", [(0.0, 1.0), (0.3, 0.9), (1.0, 1.0)])
def test_explore_hides_the_fraction_in_the_mean(rooms: int, share: tuple[float, float]) -> None:
    """Whatever the values of the exploration, and in the smallest buildings, too."""
    chosen = Exploration(not_entered=share, searched=share, glimpsed=1.0)
    for fraction in (0.1, 0.3, 0.5, 0.7, 0.9):
        recipe = MaskRecipe(strategy="explore", fraction=fraction, exploration=chosen)
        shares = np.array([view.hidden_share[0] for view in draw_views(recipe, rooms, 200)])
        assert abs(shares.mean() - fraction) < 4 * shares.std() / np.sqrt(200) + 1e-6


def test_explore_has_rooms_of_all_four_kinds() -> None:
    kinds = dict.fromkeys(("searched", "half seen", "glimpsed", "not entered"), 0)
    for view in draw_views(MaskRecipe(strategy="explore"), 12):
        share, inside = view.hidden_share[1:], view.visited[1:]
        require_connected(np.flatnonzero(inside) + 1)
        glimpsed = ~inside & (share < 1)
        half = share[inside & (share > 0)]
        kinds["searched"] += int((inside & (share == 0)).sum())
        kinds["half seen"] += len(half)
        kinds["glimpsed"] += int(glimpsed.sum())
        kinds["not entered"] += int((~inside & (share == 1)).sum())
        beside = np.convolve(inside, [1, 0, 1], mode="same") > 0
        assert beside[glimpsed].all(), "seen from a room that was entered"
        assert ((share[glimpsed] >= 0.7) & (share[glimpsed] <= 0.98)).all()
        assert len(set(half.tolist())) == len(half), "each has a share of its own"
    assert min(kinds.values()) > 0.03 * sum(kinds.values()), kinds


def test_beyond_the_frontier_no_room_is_entered() -> None:
    for view in draw_views(MaskRecipe(strategy="frontier"), 12, 60):
        require_connected(np.flatnonzero(view.visited[1:]) + 1)


def test_every_number_of_rooms_up_to_half_is_searched() -> None:
    views = draw_views(MaskRecipe(strategy="search"), 7)
    numbers = np.bincount([int((view.hidden_share[1:] == 0).sum()) for view in views], minlength=4)
    assert (numbers > 40).all()
    assert len(numbers) == 4


def test_mixed_is_a_tour_in_six_of_ten_and_else_each_of_the_others() -> None:
    """Over 1,000 draws; the logarithm of the number of rooms of a tour is uniform."""
    recipe, rooms, exact = MaskRecipe(strategy="mixed", fraction=0.4, seed=2), np.zeros(10), 0
    for view in draw_views(recipe, 9, 1000):
        rooms[len(view.nodes) - 1] += 1
        exact += view.exact
    expected = 600 * np.diff(np.log10(range(1, 11)))
    expected[-1] += 400  # the others show the whole building
    assert stats.chisquare(rooms[1:], expected).pvalue > 1e-3
    assert stats.binomtest(exact, 1000, 0.4 / 5).pvalue > 1e-3  # `uniform` is one of five


def test_a_tour_finds_rooms_over_connections() -> None:
    """The share of the rooms that it says, or their number; all of a smaller building."""
    kinds = set()
    for fraction, number in ((0.0, 1), (0.3, 4), (0.5, 6), (0.9, 11), (1.0, 12)):
        for view in draw_views(MaskRecipe(strategy="tour", fraction=fraction), 12, 40):
            assert len(view.nodes) == 1 + number
            require_connected(view.nodes[1:])
            shows = (view.hidden_share[1:] < 1).tolist()
            kinds |= set(zip(view.visited[1:].tolist(), shows, strict=True))
    assert kinds == {(True, True), (False, False), (False, True)}, "entered, not, glimpsed"
    for number in (1, 5, 12, 30):
        (view,) = draw_views(MaskRecipe(strategy="tour", rooms=number), 12, 1)
        assert len(view.nodes) == 1 + min(number, 12)


def test_a_tour_without_connections_goes_to_rooms_that_are_near_in_the_list() -> None:
    for view in draw_views(MaskRecipe(strategy="tour", rooms=6), 40, 60, connect=False):
        assert (np.diff(view.nodes[1:]) <= 2).all()


def test_objects_in_no_room_are_in_no_graph_of_a_part() -> None:
    cells = np.full((5, 2), 3)
    part, seen, _ = draw_mask(cells, MaskRecipe(strategy="tour", rooms=2))
    assert seen.tolist() == [[0, 0], [3, 3], [3, 3]]
    assert draw_mask(cells, MaskRecipe(strategy="tour", rooms=4))[1].tolist() == cells.tolist()
    whole, found = part.in_building(5), np.isin(np.arange(5), part.nodes)
    assert (whole.hidden_share[~found] == 1).all()
    assert whole.hidden_share[0] == pytest.approx(whole.hidden_share[1:].mean())
    assert whole.visited.tolist() == np.isin(np.arange(5), part.nodes[part.visited]).tolist()


def test_a_detector_that_knows_few_words_shows_no_other_class_in_any_room() -> None:
    recipe, cells = MaskRecipe(strategy="explore", detector=0.5), np.zeros((5, 45), dtype=np.int64)
    shares = []
    for draw in range(400):
        view, *_ = draw_mask(cells, recipe, draw=draw)
        (rng,) = MaskStreams([recipe], ["s"], [draw]).of("detector")
        unknown, _ = sample_unknown(rng, recipe, classes=45)
        assert (view.withheld == unknown).all()
        shares.append(unknown.mean())
        plain, *_ = draw_mask(cells, MaskRecipe(strategy="explore"), draw=draw)
        assert np.array_equal(view.hidden_share, plain.hidden_share)
    limited = np.array(shares) > 0
    assert 0.4 < limited.mean() < 0.6  # six standard deviations are .15
    assert 0.4 < np.array(shares)[limited].mean() < 0.6  # any share, equally likely
