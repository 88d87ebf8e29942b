"""Measure how fast a robot decides where to go, and how fast searches are simulated.

Orders of rooms beside OR-tools, where its model says the same: one thing that is equally likely in
every room, and so rare that rooms do not change each other's chance. It then minimises the sum of
arrivals. Without OR-tools, that row is left out. Decisions are whole: the belief, the ways between
rooms and the planner. Studies run beside the plain way: one planner after another, each of which
asks the model about whole buildings.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from timing import Speed, time_both

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_models.robot.seen_building import SeenBuilding, open_graph
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.found_model import locate_run
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.orders import expected_costs, order_rooms
from bsg_models.search.simulator import Answer, Episodes, Robot, search
from bsg_models.studies.search_beliefs import ModelBeliefs
from bsg_models.studies.search_cases import sample_episodes
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.studies.search_study import study_search
from bsg_models.zoo.model import BeliefModel

ROOMS = 200  # of an order
RARE = 1e-6  # presence in every room, for the comparison with OR-tools
LARGE = {1000: 1.0, 2000: 3.0}  # rooms of a decision → target in seconds
LOOKED = {14: 0.005, 50: 0.03, 250: 0.12}  # the same, shares told, after a look that missed
TEAM = 3  # two robots may take so many times as long as one
LABELS = ("bedroom", "kitchen", "bathroom", "living room", "hallway", "office", "closet")
STUDIED = 4  # buildings of the whole study
MINUTE = 60 / 36  # target in seconds for one building
COMPARED = StudyRecipe(episodes=10)  # in one building: the plain way takes long


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield orders of rooms, decisions and studies."""
    yield from measure_orders()
    yield from measure_decisions()
    with tempfile.TemporaryDirectory() as folder:
        source = hm3d or Path(folder, "buildings")
        if hm3d is None:
            list(write_synthetic(source, scenes=STUDIED, seed=0))
        build_dataset(HM3DFolder(source), Path(folder, "dataset"))
        yield from measure_studies(Path(folder, "dataset"))


def measure_orders() -> Iterator[Speed]:
    """Yield the order of many rooms for both tasks, and beside OR-tools."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 30, (ROOMS + 1, 2))
    ways = np.linalg.norm(places[:, None] - places, axis=2)[None]
    miss = 1 - rng.beta(0.3, 1.5, (1, ROOMS, 1)).clip(1e-6, 1)
    for task, target in (("single", 0.025), ("all", 0.05)):
        taken = time_least(lambda one=task == "single": order_rooms(ways, miss, single=one))
        what = f"expected-cost in {ROOMS} rooms, {task}"
        yield Speed(what, "", taken, None, target, kind="growth")
    theirs = order_with_or_tools(ways[0])
    if theirs is None:
        print(
            "no row beside OR-tools, which is not installed: pip install ortools", file=sys.stderr
        )
        return
    alike = np.full((1, ROOMS, 1), 1 - RARE)
    ours = time_least(lambda: order_rooms(ways, alike, single=True))
    other = time_least(lambda: order_with_or_tools(ways[0]), repeats=1)
    found = order_rooms(ways, alike, single=True), np.array([theirs])
    costs = [expected_costs(ways, alike, order, single=True).item() for order in found]
    assert costs[0] < 1.15 * costs[1], costs
    what = f"the order of {ROOMS} rooms for a thing that is equally likely in each"
    against = f"OR-tools' routing, whose order costs {costs[1] / costs[0]:.2f} × ours"
    yield Speed(what, against, ours, other, 1, at_least=True)


def time_least(call: Any, repeats: int = 5) -> float:
    """Return the least seconds of processor that a call took."""
    taken = []
    for _ in range(repeats):
        began = time.process_time()
        call()
        taken.append(time.process_time() - began)
    return min(taken)


def order_with_or_tools(ways: Floats) -> list[int] | None:
    """Return the order with the least sum of arrivals, to millimetres; None without OR-tools."""
    try:
        from ortools.constraint_solver import pywrapcp
    except ImportError:
        return None
    nodes = len(ways)
    # The way back to the start would cost nothing: the last room is the end.
    lengths = np.rint(1000 * ways).astype(int)
    lengths[:, nodes - 1] = 0
    manager = pywrapcp.RoutingIndexManager(nodes, 1, nodes - 1)
    model = pywrapcp.RoutingModel(manager)
    way = model.RegisterTransitMatrix(lengths.tolist())
    model.AddDimension(way, 0, int(lengths.sum()), True, "arrival")
    arrival = model.GetDimensionOrDie("arrival")
    for node in range(nodes - 1):
        arrival.SetCumulVarSoftUpperBound(manager.NodeToIndex(node), 0, 1)
    found = model.SolveWithParameters(pywrapcp.DefaultRoutingSearchParameters())
    order, index = [], found.Value(model.NextVar(model.Start(0)))
    while not model.IsEnd(index):
        order.append(manager.IndexToNode(index))
        index = found.Value(model.NextVar(index))
    return order


def measure_decisions() -> Iterator[Speed]:
    """Yield decisions among many rooms, with connections and without."""
    for rooms, target in LARGE.items():
        for connected in (True, False):
            seen = open_graph(write_graph(rooms, connected=connected))
            taken = time_least(lambda one=seen: decide(one), repeats=2)
            how = "of which few connect" if connected else "without connections"
            what = f"a decision among {rooms:,} rooms {how}"
            yield Speed(what, "", taken, None, target, kind="growth")

    for rooms, target in LOOKED.items():
        graph = write_graph(rooms, connected=True)
        told = [{**room, "hidden_share": 0.5} for room in graph["rooms"]]
        seen = open_graph({**graph, "rooms": told})
        alone = time_least(lambda one=seen: decide_after_look(one, robots=1))
        what = f"a decision after a sighting and a look in vain, {rooms} rooms"
        yield Speed(what, "", alone, None, target, kind="growth")
        both = time_least(lambda one=seen: decide_after_look(one, robots=2))
        yield Speed(f"the same for two robots, {rooms} rooms", "one robot", both, alone, TEAM)


def decide_after_look(seen: SeenBuilding, *, robots: int) -> None:
    """Report a sighting and a look that missed, and ask where one or two robots go."""
    seen.saw("1", "chair", object_id=str(len(seen.graph.looks) + time.process_time_ns()))
    seen.looked("0", "microwave", chance=0.8)
    if robots == 1:
        assert seen.next_room("microwave", here="0") in seen.rooms
    else:
        assert len(seen.next_rooms({"a": "0", "b": "3"}, "microwave")) == robots


def decide(seen: SeenBuilding) -> None:
    """Ask where to go after the robot's room was searched, so that nothing is known already."""
    seen.searched("0")
    assert seen.next_room("microwave", here="0") in seen.rooms


def write_graph(rooms: int, *, connected: bool) -> dict[str, Any]:
    """Return the graph of a robot in a grid of rooms, a third of which connect across."""
    rng = np.random.default_rng(0)
    wide = int(np.ceil(rooms**0.5))
    document: dict[str, Any] = {
        "scene_id": "grid",
        "rooms": [
            {
                "id": str(room),
                "room_type": LABELS[rng.integers(len(LABELS))],
                "position": [4 * x + rng.random(), 4 * y + rng.random(), 0],
            }
            for room in range(rooms)
            for y, x in [divmod(room, wide)]
        ],
    }
    if connected:
        along = [[str(room), str(room - 1)] for room in range(1, rooms) if room % wide]
        across = [
            [str(room), str(room - wide)]
            for room in range(wide, rooms)
            if room % wide == 0 or rng.random() < 1 / 3
        ]
        document["adjacency"] = along + across
    return document


class WholeBeliefs(ModelBeliefs):
    """Beliefs of which all is asked: every room, every class, and the building."""

    def __call__(self, rows: Ints, explored: Bools, *, shares: bool = True) -> Answer:
        """Return presence and share, whether the planner looks at shares or not."""
        return super().__call__(rows, explored)

    def _ask(self, states: Ints, *, shares: bool) -> tuple[Floats, Floats]:
        width, nodes = self._artifacts.shape[1], len(self._cells)
        found = self._model.expect(self._observe(states, width))
        columns = np.repeat(states[:, 1 : 1 + width], nodes, axis=0)
        shape = (len(states), nodes, width)
        share = np.take_along_axis(found.distribution, columns, axis=1).reshape(shape)
        return found.hidden_counts.take_classes(columns).presence.reshape(shape), share


def measure_studies(dataset: Path) -> Iterator[Speed]:
    """Yield a study beside planner by planner with the same costs, and one of full size."""
    data, run = Dataset.open(dataset), locate_run("ensemble")
    path = checkpoint_of(run)
    model = restore_model(path, load_checkpoint(path))
    scenes = data.scene_ids[-STUDIED:]
    drawn = [sample_episodes(data, scenes[0], world, COMPARED) for world in COMPARED.worlds]
    cases = [one for one in drawn if isinstance(one, Episodes)]

    def believe(kind: type[ModelBeliefs], episodes: Episodes) -> ModelBeliefs:
        return ask(kind, model, data, scenes[0], episodes)

    robots = {
        (task, name): Robot(PLANNERS[name], task) for task in COMPARED.tasks for name in PLANNERS
    }

    def together() -> list[Floats]:
        beliefs = believe(ModelBeliefs, cases[0])  # worlds with the same rooms share searches
        ended = [search(one, robots, beliefs=beliefs) for one in cases]
        return [outcome.costs for one in ended for outcome in one.values()]

    def one_by_one() -> list[Floats]:
        return [
            search(one, {key: robot}, beliefs=believe(WholeBeliefs, one))[key].costs
            for one in cases
            for key, robot in robots.items()
        ]

    np.testing.assert_allclose(np.array(together()), np.array(one_by_one()))
    ours, theirs = time_both(together, one_by_one, repeats=2)
    what = f"a search study, ensemble, three worlds, {COMPARED.episodes} searches"
    yield Speed(what, "each planner asking about whole buildings", ours, theirs, 6, at_least=True)
    recipe = StudyRecipe()
    taken = time_least(lambda: study_search(dataset, dict.fromkeys(scenes, run), recipe), 1)
    what = f"a search study, ensemble, three worlds, {recipe.episodes} searches, a building of 36"
    yield Speed(what, "", taken / len(scenes), None, MINUTE)


def ask(
    kind: type[ModelBeliefs], model: BeliefModel, data: Dataset, scene: str, episodes: Episodes
) -> ModelBeliefs:
    """Return beliefs about the searches of a building."""
    draws = np.arange(len(episodes.starts)) % COMPARED.draws
    return kind(
        model,
        data=data,
        scene_id=scene,
        mask=COMPARED.mask,
        draws=draws,
        artifacts=episodes.artifacts,
    )
