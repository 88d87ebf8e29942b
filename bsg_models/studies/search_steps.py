"""The steps of one search of a study, kept as it ran, so that it can be replayed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bsg_models.search.knowledge import Task
from bsg_models.search.shortest_paths import Floats
from bsg_models.search.simulator import Step


@dataclass(frozen=True, slots=True)
class KeepRequest:
    """Which searches of a study keep their steps.

    Attributes:
        episode: number of the search in its building, from 0.
        task: when it ends.
        planner: that decides, of the study's recipe.
        scene_id: of the building; None for every one.
        world: the name of the world; None for every one.
    """

    episode: int
    task: Task
    planner: str
    scene_id: str | None = None
    world: str | None = None

    def fits(self, scene_id: str, world: str) -> bool:
        """Say whether a search of this building and world is asked for."""
        return self.scene_id in (None, scene_id) and self.world in (None, world)


@dataclass(frozen=True, eq=False)
class KeptStep:
    """One decision of a planner in one search.

    Attributes:
        target: room that it named.
        entered: room that the robot entered on the way there.
        distance: `[N]` cost of going to each node, infinite out of reach.
        presence: `[N, A]` that the planner was given, of rooms that the robot had not entered.
    """

    target: int
    entered: int
    distance: Floats
    presence: Floats


@dataclass(frozen=True, eq=False)
class KeptSearch:
    """One search as it ran.

    Attributes:
        scene_id: of the building.
        world: the name of the world.
        task: when it ended.
        planner: that decided.
        episode: number of the search in its building, from 0.
        start: room where it began.
        artifacts: classes that it looked for.
        draw: number of the mask.
        steps: in order.
    """

    scene_id: str
    world: str
    task: Task
    planner: str
    episode: int
    start: int
    artifacts: tuple[int, ...]
    draw: int
    steps: tuple[KeptStep, ...]


class StepKeeper:
    """Keeps the steps of one of many searches; `keep` is the `watch` of `search`."""

    def __init__(self, episode: int) -> None:
        self._episode = episode
        self._steps: list[KeptStep] = []

    def keep(self, step: Step) -> None:
        """Keep a step, if the search takes part in it."""
        for row in np.flatnonzero(step.rows == self._episode):
            self._steps.append(
                KeptStep(
                    target=int(step.target[row]),
                    entered=int(step.entered[row]),
                    distance=step.known.distance[row].copy(),
                    presence=step.known.presence[row].copy(),
                )
            )

    @property
    def steps(self) -> tuple[KeptStep, ...]:
        """What was kept so far."""
        return tuple(self._steps)
