"""Measure how fast searches are simulated, beside a plain loop over networkx graphs.

    python scripts/bench/search.py                      # of synthetic buildings
    python scripts/bench/search.py --data hm3d          # of a dataset

First by how much the order of many rooms that is searched for costs more than the exact one. Then
the same `nearest` searches in the same worlds both ways, which must come to the same costs; and
100,000 searches in the first world, drawn and run from the dataset on. `make bench` runs `measure`
alone: one decision in 200 rooms, and a study with beliefs beside one in which every planner asks by
itself about whole buildings.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import networkx
import numpy as np
from timing import Speed, print_speeds, time_both

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.found_model import locate_run
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.orders import expected_cost, order_rooms
from bsg_models.search.room_graphs import WorldRecipe, sample_travel
from bsg_models.search.shortest_paths import Bools, Floats, Ints
from bsg_models.search.simulator import Answer, Episodes, begin_search, search, search_together
from bsg_models.studies.search_beliefs import ModelBeliefs
from bsg_models.studies.search_cases import Case, StudyRecipe, sample_case
from bsg_models.studies.search_study import study_search

WORLDS = tuple(WorldRecipe(kind=kind) for kind in ("star", "complete-paths", "tree"))
EPISODES, MANY = 200, 100_000
BUILDINGS = 30
ROOMS = 200  # of the building in which one decision is measured
STUDIED, SEARCHES = 4, 40  # buildings, and searches in each, of the study with beliefs


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


def measure() -> Iterator[Speed]:
    """Yield one decision in many rooms, and a study beside one that asks planner by planner."""
    rng = np.random.default_rng(0)
    places = rng.uniform(0, 30, (ROOMS + 1, 2))
    costs = np.linalg.norm(places[:, None] - places, axis=2)
    miss = 1 - rng.beta(0.3, 1.5, (ROOMS, 1)).clip(1e-6, 1)
    for single in (True, False):
        order_rooms(costs, ROOMS, miss, single=single)  # compiled
        taken = []
        for _ in range(5):
            began = time.perf_counter()
            order_rooms(costs, ROOMS, miss, single=single)
            taken.append(time.perf_counter() - began)
        task = "single" if single else "all"
        yield Speed(f"expected-cost in {ROOMS} rooms, {task}", "", min(taken), None, 0.05)
    with tempfile.TemporaryDirectory() as folder:
        list(write_synthetic(Path(folder, "buildings"), scenes=STUDIED, seed=0))
        build_dataset(HM3DFolder(Path(folder, "buildings")), Path(folder, "dataset"))
        yield measure_study(Dataset.open(Path(folder, "dataset")))


def measure_study(data: Dataset) -> Speed:
    """Return a study with the beliefs of `ensemble`, beside planner by planner; same costs."""
    path = checkpoint_of(locate_run("ensemble"))
    model = restore_model(path, load_checkpoint(path))
    recipe = StudyRecipe(worlds=WORLDS[:1], episodes=SEARCHES)
    cases = {
        scene: case
        for scene in data.scene_ids
        if isinstance(
            case := sample_case(data.cells(scene), WORLDS[0], recipe, scene_id=scene, measured={}),
            Case,
        )
    }

    def believe(kind: type[ModelBeliefs], scene: str) -> ModelBeliefs:
        case = cases[scene]
        return kind(
            model,
            data=data,
            scene_id=scene,
            mask=recipe.mask,
            draws=case.draws,
            artifacts=case.episodes.artifacts,
        )

    def together() -> list[Floats]:
        costs = []
        for scene, case in cases.items():
            begun = {
                (task, name): begin_search(case.episodes, PLANNERS[name], task=task)
                for task in recipe.tasks
                for name in PLANNERS
            }
            ended = search_together(begun, beliefs=believe(ModelBeliefs, scene))
            costs += [outcome.costs for outcome in ended.values()]
        return costs

    def one_by_one() -> list[Floats]:
        costs = []
        for scene, case in cases.items():
            beliefs = believe(WholeBeliefs, scene)
            costs += [
                search(case.episodes, PLANNERS[name], task=task, beliefs=beliefs).costs
                for task in recipe.tasks
                for name in PLANNERS
            ]
        return costs

    np.testing.assert_allclose(np.array(together()), np.array(one_by_one()))
    ours, theirs = time_both(together, one_by_one, repeats=1)
    what = f"a search study, {len(cases)} buildings, {SEARCHES} searches, ensemble"
    return Speed(what, "each planner asking about whole buildings", ours, theirs, 6, at_least=True)


def walk_networkx(episodes: Episodes) -> list[float]:
    """Run `nearest` searches for one instance, one after another, by Dijkstra on a graph each."""
    costs = []
    for e, start in enumerate(episodes.starts.tolist()):
        ways = episodes.travel
        graph = networkx.Graph()
        for a, b in np.argwhere(ways.steps[e] == np.arange(len(episodes.rooms))).tolist():
            if a < b:
                graph.add_edge(a, b, weight=ways.costs[e, a, b])
        holds = set(np.flatnonzero(episodes.instances[e, :, 0]).tolist())
        left = set(np.flatnonzero(episodes.rooms).tolist()) - {start}
        here, cost = start, 0.0
        while not holds & {here}:
            lengths = networkx.single_source_dijkstra_path_length(graph, here)
            here = min(left, key=lambda room: (lengths[room], room))
            cost += lengths[here]
            left.remove(here)
        costs.append(cost)
    return costs


def compare(cases: list[Case]) -> tuple[float, float]:
    """Return searches a second of networkx and of ours, after asserting the same costs."""
    began = time.perf_counter()
    plain = [walk_networkx(case.episodes) for case in cases]
    middle = time.perf_counter()
    ours = [search(case.episodes, PLANNERS["nearest"], task="single").costs for case in cases]
    ended = time.perf_counter()
    np.testing.assert_allclose(np.concatenate(plain), np.concatenate(ours))
    number = sum(len(case.episodes.starts) for case in cases)
    return number / (middle - began), number / (ended - middle)


def measure_orders(*, rooms: int = 13, cases: int = 200) -> None:
    """Print by how much more the searched order is expected to cost than the exact one."""
    print(f"\norders of {rooms} rooms, {cases} random cases: excess over the exact order, %")
    travel = sample_travel(WORLDS[1], nodes=rooms + 2, episodes=cases, scene_id="bench", seed=0)
    for single, classes in ((True, 1), (True, 2), (True, 3), (False, 1)):
        rng = np.random.default_rng(0)
        excess = []
        for costs in travel.costs[:, 1:, 1:]:  # of all rooms; the robot is in the last
            miss = 1 - rng.beta(0.3, 1.5, (rooms, classes)).clip(1e-6, 1)
            found, best = (
                expected_cost(
                    costs,
                    rooms,
                    miss,
                    order_rooms(costs, rooms, miss, single=single, exact=exact),
                    single=single,
                )
                for exact in (0, rooms)
            )
            excess.append(100 * (found / best - 1))
        task = f"single, {classes} at once" if single else "all"
        print(f"{task:24s}mean {np.mean(excess):.2f}, most {np.max(excess):.1f}")


def run(dataset: Path) -> None:
    """Print searches a second in every world, and the time of many searches."""
    data = Dataset.open(dataset)
    classes = tuple(range(len(data.manifest.class_space.classes)))
    scenes = list(data.cells)[:BUILDINGS]
    print(f"{len(scenes)} buildings, {EPISODES} searches each, nearest-first, for one instance\n")
    print(f"{'world':24s}{'networkx':>12s}{'bsg_models':>12s}  ratio")
    for world in WORLDS:
        recipe = StudyRecipe(artifacts=classes, worlds=(world,), episodes=EPISODES)
        drawn = [
            sample_case(data.cells(scene), world, recipe, scene_id=scene, measured={})
            for scene in scenes
        ]
        plain, ours = compare([case for case in drawn if isinstance(case, Case)])
        print(f"{world.name:24s}{plain:10,.0f}/s{ours:10,.0f}/s  {ours / plain:.0f} ×")
    many = StudyRecipe(
        artifacts=classes,
        worlds=WORLDS[:1],
        tasks=("single",),
        planners=("nearest",),
        episodes=-(-MANY // len(data.cells)),
    )
    began = time.perf_counter()
    study = study_search(dataset, dict.fromkeys(data.cells), many)
    number = sum(len(one.starts) for one in study.searches)
    seconds = time.perf_counter() - began
    print(f"\n{number:,} nearest searches, with the drawing of their worlds: {seconds:.1f} s")


def main() -> None:
    """Measure on a dataset, or on synthetic buildings."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=Path, help="Dataset; synthetic buildings without.")
    options = parser.parse_args()
    print_speeds(measure())
    measure_orders()
    print()
    if options.data is not None:
        run(options.data)
        return
    with tempfile.TemporaryDirectory() as folder:
        list(write_synthetic(Path(folder, "buildings"), scenes=145, seed=0))
        build_dataset(HM3DFolder(Path(folder, "buildings")), Path(folder, "dataset"))
        run(Path(folder, "dataset"))


if __name__ == "__main__":
    main()
