"""Prepare one search, by a planner and by `nearest`, for a page or an animation.

The search is not run again: the study kept its steps, and this module groups them into stops.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.scene.scene_graph import Room, SceneGraph
from bsg_models.rendering.plan import KnownOutline, Plan, draw_plan, outline_room
from bsg_models.rendering.replay import Replay, Visit, Walk
from bsg_models.search.room_graphs import MEASURED
from bsg_models.studies.savings import WorldResult
from bsg_models.studies.search_cases import BASELINE
from bsg_models.studies.search_steps import (
    LEAST_ENTERED,
    MOST_HOLDING,
    TYPICAL,
    KeptSearch,
    KeptStep,
    choose_shown,
)
from bsg_models.studies.search_study import Study

_TOLD = 6  # classes named per room


def choose_replay(study: Study, results: Sequence[WorldResult], *, named: bool) -> KeptSearch:
    """Return the kept search to show; one with costs in metres if there is one.

    Of searches that were `named` by number, the first building's is shown.
    """
    kept = [one for searches in study.searches for one in searches.kept]
    if not kept:
        raise RecipeError("the study kept no search; pass a KeepRequest to `study_search`")
    world = min((one.world for one in kept), key=lambda name: name not in MEASURED)
    there = [one for one in kept if one.world == world]
    if named:
        return there[0]
    saving = _result_of(results, there[0]).savings[there[0].planner]
    return choose_shown(there, BASELINE, saving.saved.value)


def replay_search(
    dataset: Path,
    study: Study,
    results: Sequence[WorldResult],
    kept: KeptSearch,
    *,
    model: str | None,
    named: bool,
) -> Replay:
    """Return a kept search stop by stop, with the means over all searches of the study.

    `model` is that whose beliefs the study used; `named` says that the search was named by its
    number instead of chosen by the rule.
    """
    if study.recipe.truth == "posterior":
        raise RecipeError("a replay needs searches for what is really there (--truth real)")
    graph, data = _find_building(dataset, kept.scene_id), Dataset.open(dataset)
    cells, classes = data.cells(kept.scene_id), data.manifest.class_space.classes
    ground = _Ground(cells, classes, kept)
    reachable = set(ground.reachable)
    result = _result_of(results, kept)
    walks = []
    for planner in kept.walks:
        saving = result.savings[planner]
        reads = study.planners[planner].reads == "belief"
        walks.append(
            Walk(
                planner=planner,
                model=model if reads else None,
                stops=tuple(ground.stops(planner, reads=reads)),
                mean_cost=saving.cost,
                mean_entered=saving.entered,
                mean_saved=saving.saved,
            )
        )
    measured = kept.world in MEASURED
    return Replay(
        scene_id=kept.scene_id,
        episode=kept.episode,
        artifacts=tuple(classes[c] for c in kept.artifacts),
        task=kept.task,
        world=kept.world,
        unit="m" if measured else "",
        plan=_draw([room for room in graph.rooms if room.room_index in reachable]),
        doors=tuple(
            (edge.source, edge.target)
            for edge in graph.adjacency
            if measured and {edge.source, edge.target} <= reachable
        ),
        holds=ground.holds,
        left_out=len(graph.rooms) - len(reachable),
        walks=tuple(walks),
        searches=result.searches,
        buildings=result.buildings,
        chosen=_say_why(kept, named=named),
    )


@dataclass(frozen=True, eq=False)
class _Ground:
    """The truth of the building of a search."""

    cells: Counts  # `[N, C]` objects
    classes: Sequence[str]  # `[C]` names
    kept: KeptSearch  # the search

    @property
    def reachable(self) -> tuple[int, ...]:
        """Rooms of the world."""
        first = next((walk[0] for walk in self.kept.walks.values() if walk), None)
        if first is None:
            return (self.kept.start,)
        return tuple(
            room for room in range(1, len(self.cells)) if np.isfinite(first.distance[room])
        )

    @property
    def holds(self) -> tuple[int, ...]:
        """Rooms of the world that hold an artifact."""
        sought = list(self.kept.artifacts)
        return tuple(room for room in self.reachable if self.cells[room, sought].any())

    def stops(self, planner: str, *, reads: bool) -> Iterator[Visit]:
        """Yield the start of a robot, then each room that it enters."""
        walk = self.kept.walks[planner]
        room, cost = self.kept.start, 0.0
        way: tuple[int, ...] = ()
        found: set[int] = set()
        for step in (*walk, None):
            here = [c for c in self.kept.artifacts if self.cells[room, c]]
            found.update(here if self.kept.task == "single" else ())
            given = step or (walk[-1] if walk else None)
            yield Visit(
                room=room,
                way=tuple(node for node in way if node),  # node 0 is the building, not a room
                cost=round(cost, 3),
                seen=self._list_seen(room),
                found=tuple(self.classes[c] for c in here),
                presence=self._believe(given, room, found) if reads and given else None,
                target=None if step is None else step.target,
                leg=None if step is None else round(float(step.distance[step.target]), 3),
            )
            if step is not None:
                room, way, cost = step.entered, step.way, cost + step.cost

    def _list_seen(self, room: int) -> tuple[tuple[str, int], ...]:
        """Return the content of a room: artifacts first, then the most frequent classes."""
        counts, sought = self.cells[room], np.zeros(len(self.classes), dtype=bool)
        sought[list(self.kept.artifacts)] = True
        order = np.lexsort((-counts, ~sought)).tolist()
        there = [(self.classes[c], int(counts[c])) for c in order if counts[c]]
        return tuple(there[:_TOLD])

    def _believe(self, step: KeptStep, room: int, found: set[int]) -> tuple[float, ...]:
        """Return P(a room holds an artifact that is not found yet), `[R]`."""
        sought = [a for a, c in enumerate(self.kept.artifacts) if c not in found]
        presence = 1 - (1 - step.presence[1:, sought or slice(None)]).prod(axis=1)
        presence[room - 1] = 0.0
        return tuple(np.round(presence, 4).tolist())


def _draw(rooms: Iterable[Room]) -> Plan:
    """Return the plan of some rooms, with the names of their source."""
    return draw_plan(
        [
            KnownOutline(
                room.room_index, _name(room), outline_room(room, room.centroid), room.floor_index
            )
            for room in rooms
        ]
    )


def _name(room: Room) -> str:
    return room.source_label or room.label or f"room {room.region_id}"


def _find_building(dataset: Path, scene_id: str) -> SceneGraph:
    for graph in read_scene_graphs(dataset):
        if graph.scene_id == scene_id:
            return graph
    raise DatasetError(f"{dataset}: has no scene {scene_id!r}")


def _result_of(results: Sequence[WorldResult], kept: KeptSearch) -> WorldResult:
    return next(one for one in results if (one.world, one.task) == (kept.world, kept.task))


def _say_why(kept: KeptSearch, *, named: bool) -> str:
    """Return why this search is shown."""
    if named:
        return "This search was named by its number, so it need not be typical."
    if not kept.eventful:
        return (
            "This search was chosen as worth watching, but no search met the rule: artifacts are "
            "in many rooms, or a robot finds one within a few rooms. Of the searches whose "
            "saving is nearest to that of all, it is the one in which beliefs change most."
        )
    return (
        "This search was chosen as worth watching, by a rule. "
        f"At most {100 * MOST_HOLDING:.0f} % of the rooms hold what is sought, and every robot "
        f"enters at least {LEAST_ENTERED} rooms. The saving is within {100 * TYPICAL:.0f} points "
        "of that of all searches, or as near as there is. Of these searches, beliefs change most "
        "in this one."
    )
