"""The simulator and the planners: by hand, and what must hold in every world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_models.search.catalogue import PLANNERS, Planner
from bsg_models.search.knowledge import Knowledge, Task, Travel, find_ways
from bsg_models.search.looks import look_again
from bsg_models.search.plans import plan_search
from bsg_models.search.problem import pose_search
from bsg_models.search.room_graphs import WorldRecipe, sample_travel
from bsg_models.search.simulator import (
    Answer,
    Beliefs,
    Episodes,
    Outcome,
    Robot,
    Step,
    search,
    search_together,
)

Floats = npt.NDArray[np.float64]
SEARCHED = 50  # problems, of 400 searches each
TASKS: tuple[Task, ...] = ("single", "all")


def fix_beliefs(presence: Floats) -> Beliefs:
    """Return beliefs that exploration does not change."""

    def answer(rows: npt.NDArray[np.int64], explored: object) -> Answer:
        return presence[rows], presence[rows]

    return answer


def in_a_row(costs: list[float], instances: list[int], *, start: int) -> Episodes:
    """Return one search among rooms 1, 2, … in a row, with the costs between neighbours."""
    nodes = len(instances) + 1
    edges = np.full((1, nodes, nodes), np.inf)
    for room, cost in enumerate(costs, 1):
        edges[0, room, room + 1] = edges[0, room + 1, room] = cost
    return Episodes(
        travel=find_ways(edges),
        rooms=np.arange(nodes) > 0,
        starts=np.array([start]),
        artifacts=np.array([[5]]),
        instances=np.array([0, *instances])[None, :, None],
    )


def draw_episodes(seed: int, *, rooms: int, kind: str) -> Episodes:
    """Return six random searches whose artifacts are somewhere, and not where they start."""
    rng = np.random.default_rng(seed)
    recipe = WorldRecipe(kind=kind)  # type: ignore[arg-type]
    instances = rng.poisson(0.6, (6, rooms + 1, 1))
    starts = 1 + rng.integers(rooms, size=6)
    instances[np.arange(6), starts] = 0
    instances[:, 0] = 0
    elsewhere = 1 + starts % rooms
    instances[np.arange(6), elsewhere] = np.maximum(1, instances[np.arange(6), elsewhere])
    return Episodes(
        travel=sample_travel(recipe, nodes=rooms + 1, episodes=6, scene_id="s", seed=seed),
        rooms=np.arange(rooms + 1) > 0,
        starts=starts,
        artifacts=np.zeros((6, 1), dtype=np.int64),
        instances=instances,
    )


def run_one(
    episodes: Episodes,
    name: str,
    task: Task,
    *,
    beliefs: Beliefs | None = None,
    steps: list[Step] | None = None,
) -> Outcome:
    """Run all searches with one planner."""
    watched = [] if steps is None else steps
    robots = {name: Robot(PLANNERS[name], task)}
    watch = lambda _, step: watched.append(step)  # noqa: E731
    return search(episodes, robots, beliefs=beliefs, watch=watch)[name]


def test_nearest_first_by_hand() -> None:
    row = in_a_row([2, 1, 1, 5], [0, 0, 0, 1, 1], start=2)  # 1 –2– 2 –1– 3 –1– 4 –5– 5
    single = run_one(row, "nearest", "single")
    assert (single.costs[0], single.entered[0]) == (2.0, 2)  # 3, then 4
    everything = run_one(row, "nearest", "all")
    assert everything.costs[0] == 1 + 1 + (1 + 1 + 2) + (2 + 1 + 1 + 5)  # 3, 4, back to 1, then 5


def test_several_classes_single_needs_one_of_each() -> None:
    row = in_a_row([1, 1, 1], [0, 0, 0, 0], start=1)
    instances = np.zeros((1, 5, 2), dtype=np.int64)
    instances[0, 2, 0] = instances[0, 3, 0] = 1
    instances[0, 4, 1] = 1
    both = replace(row, artifacts=np.array([[5, 6]]), instances=instances)
    assert run_one(both, "nearest", "single").costs[0] == 3.0


@given(
    seed=st.integers(0, 2**32),
    rooms=st.integers(2, 9),
    kind=st.sampled_from(["star", "complete", "tree"]),
    task=st.sampled_from(TASKS),
)
@settings(max_examples=40, deadline=None)
def test_the_oracle_is_never_beaten(seed: int, rooms: int, kind: str, task: Task) -> None:
    episodes = draw_episodes(seed, rooms=rooms, kind=kind)
    beliefs = fix_beliefs(np.random.default_rng(seed).random(episodes.instances.shape))
    best = run_one(episodes, "oracle", task).costs
    for name in PLANNERS:
        found = run_one(episodes, name, task, beliefs=beliefs)
        assert (found.costs >= best - 1e-9).all()
        assert (found.entered <= rooms - 1).all()


@given(
    seed=st.integers(0, 2**32),
    kind=st.sampled_from(["star", "complete", "tree"]),
)
@settings(max_examples=30, deadline=None)
def test_with_a_perfect_belief_expected_cost_is_the_oracle(seed: int, kind: str) -> None:
    episodes = draw_episodes(seed, rooms=7, kind=kind)
    truth = fix_beliefs((episodes.instances > 0).astype(float))
    planned = run_one(episodes, "expected-cost", "single", beliefs=truth)
    known = run_one(episodes, "oracle", "single")
    np.testing.assert_allclose(planned.costs, known.costs, rtol=1e-4)


def routes(episodes: Episodes, name: str, task: Task) -> list[list[int]]:
    """Return the rooms that each search enters, in order."""
    steps: list[Step] = []
    beliefs = fix_beliefs(np.random.default_rng(0).random(episodes.instances.shape))
    run_one(episodes, name, task, beliefs=beliefs, steps=steps)
    return [
        [int(step.entered[step.rows == e][0]) for step in steps if e in step.rows]
        for e in range(len(episodes.starts))
    ]


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("name", [n for n in PLANNERS if PLANNERS[n].reads != "truth"])
def test_no_planner_knows_the_truth(name: str, task: Task) -> None:
    """Wherever the artifact is put, the robot goes the same way until it has found it."""
    episodes = draw_episodes(1, rooms=8, kind="tree")
    everywhere = np.ones_like(episodes.instances)
    everywhere[np.arange(6), episodes.starts] = everywhere[:, 0] = 0
    whole = routes(replace(episodes, instances=everywhere), name, "all")
    last = [route[-1] for route in whole]
    hidden = np.zeros_like(episodes.instances)
    hidden[np.arange(6), last] = 1
    assert routes(replace(episodes, instances=hidden), name, "all") == whole
    found = routes(episodes, name, task)
    for one, longest in zip(
        found, routes(replace(episodes, instances=hidden), name, task), strict=True
    ):
        assert one == longest[: len(one)]


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("name", PLANNERS.names())
def test_a_search_goes_the_same_way_alone_and_among_others(name: str, task: Task) -> None:
    for kind in ("star", "tree"):
        episodes = draw_episodes(2, rooms=7, kind=kind)
        presence = np.random.default_rng(0).random(episodes.instances.shape)
        together = run_one(episodes, name, task, beliefs=fix_beliefs(presence))
        for row in range(6):
            alone = take_one(episodes, row)
            ended = run_one(alone, name, task, beliefs=fix_beliefs(presence[[row]]))
            assert ended.costs[0] == together.costs[row]


def take_one(episodes: Episodes, row: int) -> Episodes:
    travel = Travel(episodes.travel.costs[[row]], episodes.travel.steps[[row]])
    return replace(
        episodes,
        travel=travel,
        starts=episodes.starts[[row]],
        artifacts=episodes.artifacts[[row]],
        instances=episodes.instances[[row]],
    )


# Looks that cost something, and may miss


def test_a_robot_that_looks_passes_rooms_without_looking() -> None:
    """Rooms 1, 2, 3 in a row: it goes from 1 to 3 past 2, and pays the way and one look."""
    episodes = replace(in_a_row([2, 3], [0, 1, 1], start=1), look=np.array([0, 9, 9, 4.0]))
    presence = np.array([[[0], [0.01], [0.05], [0.9]]])
    ended = run_one(episodes, "greedy-belief", "single", beliefs=fix_beliefs(presence))
    assert (ended.costs[0], ended.entered[0]) == (2 + 3 + 4, 1)
    at_once = replace(episodes, look=None)
    passed = run_one(at_once, "greedy-belief", "single", beliefs=fix_beliefs(presence))
    assert (passed.costs[0], passed.entered[0]) == (2, 1)  # room 2 has one, too


def test_a_look_that_misses_is_made_again_when_that_is_best() -> None:
    """It misses in room 1: at once if that is where it is, and after the others if it may be there.

    Second looks find less, so they come in the order in which they are near: 3, 2, and then 1.
    """
    luck = np.ones((1, 4, 3))
    luck[0, 1, 0] = 0.1  # below the chance to miss
    row = in_a_row([2, 3], [1, 0, 0], start=1)
    episodes = replace(row, look=np.array([0, 5, 5, 5.0]), chance=0.8, luck=luck)
    for likely, costs in {0.9: [5, 5], 0.3: [5, 2 + 5, 3 + 5, 5, 3 + 5, 2 + 5]}.items():
        beliefs = fix_beliefs(np.array([[[0], [likely], [0.3], [0.3]]]))
        ended = run_one(episodes, "expected-cost", "single", beliefs=beliefs)
        assert (ended.costs[0], ended.entered[0]) == (sum(costs), len(costs))
    ended = run_one(episodes, "nearest", "single")
    assert (ended.costs[0], ended.entered[0]) == (sum(costs), 6)


def draw_luck(rng: np.random.Generator, searches: int, *, rooms: int, looks: int) -> Floats:
    """Return the luck of some looks in each room; those after them miss nothing."""
    luck = np.ones((searches, rooms + 1, 64))
    luck[..., :looks] = rng.random((searches, rooms + 1, looks))
    return luck


@given(seed=st.integers(0, 2**32), task=st.sampled_from(TASKS))
@settings(max_examples=4, deadline=None)
def test_with_looks_that_may_miss_every_search_ends_and_the_oracle_is_best(
    seed: int, task: Task
) -> None:
    rng = np.random.default_rng(seed)
    plain = draw_episodes(seed, rooms=4, kind="tree")
    luck = draw_luck(rng, 6, rooms=4, looks=3)
    episodes = replace(plain, look=rng.uniform(0.5, 5, 5), chance=0.6, luck=luck)
    beliefs = fix_beliefs(rng.random((6, 5, 1)))
    best = run_one(episodes, "oracle", task)
    for name in ("nearest", "ratio", "expected-cost", "greedy-belief", "greedy-share"):
        ended = run_one(episodes, name, task, beliefs=beliefs)
        assert (ended.entered >= 1).all()
        assert np.isfinite(ended.costs).all()
        if task == "single":
            holders = episodes.instances.any(axis=2).sum(axis=1)
            alone = holders == 1  # else it may be luckier elsewhere
            assert (best.costs[alone] <= ended.costs[alone] + 1e-9).all()


def _follow(known: Knowledge, turns: Iterator[int]) -> npt.NDArray[np.int64]:
    return np.full(len(known.here), next(room for room in turns if known.unexplored[:, room].all()))


def test_searches_cost_what_the_law_expects() -> None:
    """Of those in which a plan with second looks finds one: by how many errors means are off."""
    off = []
    for seed in range(SEARCHED):
        rng = np.random.default_rng(seed)
        rooms, episodes = int(rng.integers(2, 6)), 400
        chance, likely = float(rng.uniform(0.3, 0.9)), rng.beta(0.7, 1, rooms)
        plain = in_a_row([*rng.uniform(1, 9, rooms - 1)], [0] * rooms, start=1)
        ways = np.repeat(plain.travel.costs, episodes, axis=0)
        travel = replace(plain.travel, costs=ways, steps=np.repeat(plain.travel.steps, episodes, 0))
        instances = np.zeros((episodes, rooms + 1, 1), dtype=np.int64)
        instances[:, 1:, 0] = rng.random((episodes, rooms)) < likely
        instances = instances[instances.any(axis=(1, 2))]
        some, look = len(instances), np.append(0.0, rng.uniform(1, 9, rooms))
        world = Episodes(
            travel=replace(travel, costs=ways[:some], steps=travel.steps[:some]),
            rooms=np.arange(rooms + 1) > 0,
            starts=np.ones(some, dtype=np.int64),
            artifacts=np.zeros((some, 1), dtype=np.int64),
            instances=instances,
            look=look,
            chance=chance,
            luck=draw_luck(rng, some, rooms=rooms, looks=3),
        )
        by_then = np.array([(0.0, *look_again((), chance, looks=3))]).T * likely
        finds = np.diff(by_then, axis=0)[None, :, :, None]
        start = np.append(np.arange(rooms), 0)  # the robot is in the first room
        between = ways[0, 1:, 1:][start]
        problem, place = pose_search(between[None], finds, look=look[1:], single=True)
        plan = plan_search(problem)[0]
        order = [1 + int(place[0, planned]) for planned in plan]
        turns = iter(order * 99)
        follow = Planner(lambda known, turns=turns: _follow(known, turns))  # type: ignore[misc]
        beliefs = fix_beliefs(np.zeros((some, rooms + 1, 1)))
        ended = search(world, {"plan": Robot(follow, "single")}, beliefs=beliefs)["plan"]
        costs = ended.costs[ended.entered <= len(order)]
        error = costs.std() / np.sqrt(len(costs))
        off.append((costs.mean() - problem.expect(plan[None])[0]) / max(error, 1e-9))
    assert np.mean(np.abs(off) < 3) > 0.98
    assert abs(np.mean(off)) < 3 / np.sqrt(len(off))
    assert np.std(off) == pytest.approx(1, abs=0.3)


# Robots that share what they see


@pytest.mark.parametrize(
    ("instances", "starts", "presence", "time", "looks"),
    [
        # In 1 and 5 until 3 s; then in 2 and 4 until 8 s; the first goes on to 3.
        ([0, 0, 1, 0, 0], [1, 5], None, 3 + 5 + 5, 5),
        ([0, 0, 0, 0, 1], [1, 4], [0.01, 0.01, 0.01, 0.01, 0.9], 2 + 3, 2),
        ([0, 1], [1, 1, 1], None, 2 + 3, 2),  # a robot that finds no room left waits
    ],
)
def test_robots_share_the_rooms(
    instances: list[int], starts: list[int], presence: list[float] | None, time: int, looks: int
) -> None:
    """In a row of rooms 2 m apart, in which a look costs 3."""
    row = in_a_row([2.0] * (len(instances) - 1), instances, start=1)
    row = replace(row, look=np.full(len(instances) + 1, 3.0))
    beliefs = presence and fix_beliefs(np.array([0.0, *presence])[None, :, None])
    ended = search_together(row, np.array([starts]), beliefs=beliefs or None)
    assert (ended.costs[0], ended.entered[0]) == (time, looks)
