"""Keep searches of a study step by step, and prepare one for a page or an animation.

A caller may name one search by its number. Without a number, the study shows a search that is worth
watching. The rule does not favour a planner:

1. Eventful: at most `MOST_HOLDING` of the rooms hold an artifact, and every robot enters
   `LEAST_ENTERED` rooms or more.
2. Typical: its saving is within `TYPICAL` of that of all searches together, or as near as there
   is.
3. Of these searches, the one in which beliefs change most.

If no search is eventful, rules 2 and 3 choose among all. The saving of all searches is known only
at the end, so each building keeps `KEPT` searches by rules 1 and 3.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bsg_data.arrays import Counts, Floats
from bsg_data.dataset.dataset import Dataset
from bsg_models.rendering.replay import Visit
from bsg_models.search.catalogue import Planner
from bsg_models.search.knowledge import Task
from bsg_models.search.simulator import Episodes, Outcome, Step

MOST_HOLDING = 0.25  # share of the rooms, without the start
LEAST_ENTERED = 4  # rooms, without the start
TYPICAL = 0.15
KEPT = 16
_TOLD = 6  # classes named per room
Steps = dict[tuple[Task, str], list[Step]]  # of the planner and of `nearest`, in this order


@dataclass(frozen=True, eq=False)
class KeptSearch:
    """One search by one planner and by `nearest`: same start, artifacts and costs."""

    scene_id: str  # of the building
    world: str  # name of the world
    task: Task  # when it ended
    planner: str  # that was asked for
    episode: int  # number of the search in its building, from 0
    artifacts: tuple[str, ...]  # classes that it looked for
    rooms: tuple[int, ...]  # that can be reached
    holds: tuple[int, ...]  # of these, those that hold an artifact
    eventful: bool  # whether few rooms hold an artifact and every robot enters many
    change: float  # of its beliefs, see `belief_changes`
    saved: float  # 1 − ratio of the planner's cost to that of `nearest`
    walks: Mapping[str, tuple[Visit, ...]]  # planner → its rooms; the requested planner is first


def keep_searches(
    steps: Steps,
    episode: int | None,
    *,
    data: Dataset,
    scene_id: str,
    world: str,
    episodes: Episodes,
    outcomes: Mapping[tuple[Task, str], Outcome],
    planners: Mapping[str, Planner],
) -> Iterator[KeptSearch]:
    """Yield a search of a building in a world by its number, or at most `KEPT` by rules 1 and 3."""
    (ours, base), ((task, planner), _) = [outcomes[robot] for robot in steps], steps
    entered = np.minimum(ours.entered, base.entered)
    eventful = (episodes.random_success <= MOST_HOLDING) & (entered >= LEAST_ENTERED)
    changes = belief_changes(steps[task, planner], len(episodes.starts))
    chosen = np.lexsort((-changes, ~eventful))[:KEPT].tolist()
    classes, rooms = data.manifest.class_space.classes, np.flatnonzero(episodes.rooms)
    for number in chosen if episode is None else [episode]:
        cost, sought = base.costs[number], episodes.artifacts[number].tolist()
        holds = episodes.instances[number, rooms].any(axis=1)
        yield KeptSearch(
            scene_id=scene_id,
            world=world,
            task=task,
            planner=planner,
            episode=number,
            artifacts=tuple(classes[c] for c in sought),
            rooms=tuple(rooms.tolist()),
            holds=tuple(rooms[holds].tolist()),
            eventful=bool(eventful[number]),
            change=float(changes[number]),
            saved=float(1 - ours.costs[number] / cost) if cost else 0.0,
            walks={
                name: tuple(
                    list_visits(
                        walk_of(of_robot, number),
                        start=int(episodes.starts[number]),
                        sought=sought,
                        cells=data.cells(scene_id),
                        classes=classes,
                        reads=planners[name].reads == "belief",
                    )
                )
                for (_, name), of_robot in steps.items()
            },
        )


def walk_of(steps: Sequence[Step], episode: int) -> list[Step]:
    """Return the steps of one search out of those of many that ran in lockstep."""
    rows = [np.flatnonzero(step.rows == episode) for step in steps]
    return [
        Step(
            rows=step.rows[row],
            known=step.known.take(row),
            target=step.target[row],
            entered=step.entered[row],
            towards=step.towards[row],
        )
        for step, row in zip(steps, rows, strict=True)
        if len(row)
    ]


def list_visits(
    walk: Sequence[Step],
    *,
    start: int,
    sought: Sequence[int],
    cells: Counts,
    classes: Sequence[str],
    reads: bool,
) -> Iterator[Visit]:
    """Yield the start of a robot, then each room that it enters.

    Args:
        walk: its steps, of one search each.
        start: room where it begins.
        sought: classes that it looks for.
        cells: `[N, C]` objects.
        classes: `[C]` names.
        reads: whether its planner reads a belief.
    """
    room, cost = start, 0.0
    way: tuple[int, ...] = ()
    found: set[int] = set()
    for step in (*walk, None):
        here = [c for c in sought if cells[room, c]]
        given = step or (walk[-1] if walk else None)
        if given is not None and given.known.task == "single":
            found.update(here)
        target = None if step is None else int(step.target[0])
        yield Visit(
            room=room,
            way=way,
            cost=round(cost, 3),
            seen=tuple(_list_seen(cells[room], sought, classes)),
            found=tuple(classes[c] for c in here),
            presence=_believe(given, room, sought, found) if reads and given else None,
            target=target,
            leg=None if step is None else round(float(step.known.distance[0, target]), 3),
        )
        if step is not None:
            way, room = _way_of(step), int(step.entered[0])
            cost += float(step.known.distance[0, room])


def _way_of(step: Step) -> tuple[int, ...]:
    """Return the rooms after the robot's own, up to the one that it enters."""
    way = [int(step.towards[0, step.known.here[0]])]
    while way[-1] != step.entered[0]:
        way.append(int(step.towards[0, way[-1]]))
    return tuple(node for node in way if node)  # node 0 is the building, not a room


def _list_seen(
    counts: Counts, sought: Sequence[int], classes: Sequence[str]
) -> list[tuple[str, int]]:
    """Return the content of a room: artifacts first, then the most frequent classes."""
    there = np.flatnonzero(counts).tolist()
    there.sort(key=lambda c: (c not in sought, -counts[c]))
    return [(classes[c], int(counts[c])) for c in there[:_TOLD]]


def _believe(step: Step, room: int, sought: Sequence[int], found: set[int]) -> tuple[float, ...]:
    """Return P(a room holds an artifact that is not found yet), `[R]`; of all once all are."""
    open_ = [a for a, c in enumerate(sought) if c not in found]
    given = step.known.presence[0]
    presence = 1 - (1 - given[1:, open_ or slice(None)]).prod(axis=1)
    presence[room - 1] = 0.0
    return tuple(np.round(presence, 4).tolist())


def belief_changes(steps: Sequence[Step], searches: int) -> Floats:
    """Return how much beliefs changed in each of E searches in lockstep, `[E]`.

    The value sums over the steps. Each step adds the mean change of P(a room holds an artifact)
    since the step before, over the rooms not yet entered.
    """
    changes = np.zeros(searches)
    for before, after in pairwise(steps):
        same = np.searchsorted(before.rows, after.rows)  # searches may end, but none begins
        moved = np.abs(after.known.any_presence - before.known.any_presence[same])
        open_ = after.known.unexplored
        changes[after.rows] += (moved * open_).sum(axis=1) / np.maximum(open_.sum(axis=1), 1)
    return changes
