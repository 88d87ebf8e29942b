"""Compare our decisions with those of POUCT, the planner of pomdp-py, on the same small searches.

    pip install pomdp-py==1.3.5.1
    python scripts/measure/pouct.py --out docs/results/figures.json

One thing is in one of three to seven rooms, by known probabilities. Going costs the way, looking
costs something and misses with a known chance. Both planners choose the next room after every look,
until it is found. The searches are the same: the thing, and the luck of every look.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pomdp_py
from results import ResultsTable, write_figures

from bsg_data.arrays import Bools, Floats
from bsg_models.robot.decision import Decision, choose_room
from bsg_models.robot.ways import Ways

PROBLEMS, SEARCHES = 50, 10
MOST_LOOKS = 60
SIMULATIONS = (100, 1000)  # of POUCT, for each decision
Choice = Callable[["Problem", Floats, Floats, int], int]


@dataclass(frozen=True, eq=False)
class Problem:
    """Rooms 1..R, of which one has the thing; node 0 stands for the building."""

    ways: Floats  # [1 + R, 1 + R]
    look: Floats  # [1 + R]
    likely: Floats  # [1 + R] P(the thing is there)
    chance: float
    here: int


def draw_problem(seed: int) -> Problem:
    """Return a random problem: rooms in a plane, looks of 1 to 8 m, a chance of .6 to 1."""
    rng = np.random.default_rng(seed)
    rooms = int(rng.integers(3, 8))
    places = rng.uniform(0, 15, (rooms + 1, 2))
    ways = np.linalg.norm(places[:, None] - places, axis=2)
    ways[0], ways[:, 0] = np.inf, np.inf
    likely = np.concatenate([[0.0], rng.dirichlet(np.full(rooms, 0.6))])
    here = int(rng.integers(1, rooms + 1))
    return Problem(ways, rng.uniform(1, 8, rooms + 1), likely, float(rng.uniform(0.6, 1)), here)


def choose_ours(problem: Problem, likely: Floats, looks: Floats, here: int) -> int:
    """Return the room of our decision: each room has it with its probability, independently."""
    again = (np.arange(len(looks)) == here) & (looks > 0)
    return _choose(problem, likely, (1 - problem.chance) ** looks, again, here)


def choose_freely(problem: Problem, likely: Floats, looks: Floats, here: int) -> int:
    """Return the room of our decision if no room had to wait for another look."""
    return _choose(problem, likely, np.ones(len(looks)), np.zeros(len(looks), dtype=bool), here)


def _choose(problem: Problem, likely: Floats, missed: Floats, again: Bools, here: int) -> int:
    finds = likely * problem.chance
    columns = (part[:, None] for part in (finds, missed, again))
    decision = Decision(*columns, task="single", things=(0,))
    ways = Ways(problem.ways, problem.ways, "m", 5.0, 1.0)
    chosen = choose_room(decision, ways, problem.look, here=here, planner="expected-cost")
    return int(chosen or here)


class _State(pomdp_py.State):
    def __init__(self, here: int, thing: int, *, found: bool = False) -> None:
        self.here, self.thing, self.found = here, thing, found

    def __hash__(self) -> int:
        return hash((self.here, self.thing, self.found))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _State) and vars(self) == vars(other)


class _Look(pomdp_py.Action):
    def __init__(self, room: int) -> None:
        self.room = room

    def __hash__(self) -> int:
        return self.room

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Look) and other.room == self.room


class _Seen(pomdp_py.Observation):
    def __init__(self, *, found: bool) -> None:
        self.found = found

    def __hash__(self) -> int:
        return int(self.found)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Seen) and other.found == self.found


def choose_by_pouct(simulations: int) -> Choice:
    """Return a choice by POUCT with so many simulations."""

    def choose(problem: Problem, likely: Floats, looks: Floats, here: int) -> int:
        class Transition(pomdp_py.TransitionModel):
            def sample(self, state: Any, action: Any) -> _State:
                lucky = random.random() < problem.chance
                found = state.found or (state.thing == action.room and lucky)
                return _State(action.room, state.thing, found=found)

        class Observe(pomdp_py.ObservationModel):
            def sample(self, state: Any, action: Any) -> _Seen:
                return _Seen(found=state.found)

        class Reward(pomdp_py.RewardModel):
            def sample(self, state: Any, action: Any, _: Any) -> float:
                cost = problem.ways[state.here, action.room] + problem.look[action.room]
                return 0.0 if state.found else -float(cost)

        rooms = [_Look(room) for room in range(1, len(likely))]

        class Policy(pomdp_py.RolloutPolicy):
            def get_all_actions(self, *_: Any, **__: Any) -> list[_Look]:
                return rooms

            def rollout(self, state: Any, history: Any = None) -> _Look:
                return random.choice(rooms)

        belief = pomdp_py.Histogram(
            {_State(here, room): float(likely[room]) for room in range(1, len(likely))}
        )
        agent = pomdp_py.Agent(belief, Policy(), Transition(), Observe(), Reward())
        planner = pomdp_py.POUCT(
            max_depth=12,
            discount_factor=0.999,
            num_sims=simulations,
            exploration_const=30.0,
            rollout_policy=agent.policy_model,
        )
        return int(planner.plan(agent).room)

    return choose


def search(
    problem: Problem, choose: Choice, *, thing: int, luck: Floats
) -> tuple[float, list[float]]:
    """Return the cost of a search, and the seconds of its decisions."""
    likely, looks = problem.likely.copy(), np.zeros(len(problem.likely))
    here, cost, seconds = problem.here, 0.0, []
    for _ in range(MOST_LOOKS):
        start = time.perf_counter()
        room = choose(problem, likely, looks, here)
        seconds.append(time.perf_counter() - start)
        cost += float(problem.ways[here, room] + problem.look[room])
        here = room
        if room == thing and luck[room, int(looks[room])] < problem.chance:
            break
        looks[room] += 1
        likely[room] *= 1 - problem.chance
        likely /= likely.sum()
    return cost, seconds


def compare() -> list[Sequence[str]]:
    """Return the mean cost of each planner, and its time for a decision."""
    planners: dict[str, Choice] = {
        "`next_room`": choose_ours,
        "the same, free to look again at once": choose_freely,
    }
    planners |= {f"POUCT, {n:,} simulations": choose_by_pouct(n) for n in SIMULATIONS}
    costs: dict[str, list[float]] = {name: [] for name in planners}
    times: dict[str, list[float]] = {name: [] for name in planners}
    for number in range(PROBLEMS):
        problem, rng = draw_problem(number), np.random.default_rng(1000 + number)
        for _ in range(SEARCHES):
            thing = int(rng.choice(len(problem.likely), p=problem.likely))
            luck = rng.random((len(problem.likely), MOST_LOOKS))
            for name, choose in planners.items():
                cost, seconds = search(problem, choose, thing=thing, luck=luck)
                costs[name].append(cost)
                times[name] += seconds
        print(f"{number + 1} of {PROBLEMS}", file=sys.stderr)
    ours = np.array(costs["`next_room`"])
    rows = []
    for name, found in costs.items():
        more = np.array(found) - ours
        spread = 1.96 * more.reshape(PROBLEMS, -1).mean(axis=1).std() / np.sqrt(PROBLEMS)
        change = "–" if found is costs["`next_room`"] else f"{more.mean():+.1f} ± {spread:.1f}"
        rows.append([name, f"{np.mean(found):.1f}", change, f"{1e3 * np.median(times[name]):.1f}"])
    return rows


def main(argv: Sequence[str]) -> None:
    """Compare, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(argv[1:])
    random.seed(0)
    rows = compare()
    reading = (
        f"{SEARCHES} searches of each of {PROBLEMS} random buildings of 3 to 7 rooms; ± is half a "
        "95 % interval over buildings, of the paired difference."
    )
    header = ("planner", "cost, m", "against `next_room`", "a decision, ms")
    table = ResultsTable("Decisions beside POUCT", header, rows, reading)
    for row in rows:
        print(" | ".join(row))
    packages = ("belief-scene-graphs", "pomdp-py", "numpy")
    write_figures(options.out, "pouct", [table], argv=argv, packages=packages)


if __name__ == "__main__":
    main(sys.argv)
