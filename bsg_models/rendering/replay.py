"""A search by two planners side by side, and its page.

`replay.html.jinja` is filled with the record as JSON. Everything that comes from the data is put on
the page as text, never as markup.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.rendering.pages import render_page
from bsg_models.rendering.plan import Plan


@dataclass(frozen=True, slots=True)
class Visit:
    """One room of a robot's route, and what the robot knows there."""

    room: int  # 1..R
    way: tuple[int, ...]  # rooms passed since the previous visit, this one last; empty at the start
    cost: float  # travelled so far
    seen: tuple[tuple[str, int], ...]  # (class, number): artifacts first, then the most frequent
    found: tuple[str, ...]  # artifacts that are in the room
    # [R] P(a room holds an artifact that is still sought), 0 for entered rooms: what the planner
    # received here; once the search is over, what it received last. None without a belief.
    presence: tuple[float, ...] | None
    target: int | None  # next room; None at the end
    leg: float | None  # cost of the way to it


@dataclass(frozen=True, slots=True)
class Walk:
    """One search by one planner, with the means over all searches of the study."""

    planner: str
    model: str | None  # whose beliefs it received
    stops: tuple[Visit, ...]  # the start, then the rooms in the order entered
    mean_cost: float
    mean_entered: float  # rooms
    mean_saved: Estimate  # compared with `nearest`

    @property
    def cost(self) -> float:
        """Cost of the whole search."""
        return self.stops[-1].cost


@dataclass(frozen=True, slots=True)
class Replay:
    """One search by one or several planners: same start, artifacts and costs."""

    scene_id: str
    episode: int  # number of the search in its building
    artifacts: tuple[str, ...]  # names of the classes that are sought
    task: str  # when the search ends, `single` or `all`
    world: str  # its name; it sets the costs
    unit: str  # of costs, `m`; empty if costs are drawn at random
    plan: Plan  # of the rooms that can be reached
    doors: tuple[tuple[int, int], ...]  # pairs of connected rooms; empty if costs are drawn
    holds: tuple[int, ...]  # rooms that hold an artifact (no robot knows them)
    left_out: int  # number of rooms that cannot be reached; they are not drawn
    walks: tuple[Walk, ...]  # the planner's, then those it is compared with
    searches: int  # number in the study, in this world and task
    buildings: int  # likewise
    chosen: str  # why this search is shown, in a sentence or two

    @property
    def steps(self) -> int:
        """The largest number of rooms that one robot enters."""
        return max(len(walk.stops) for walk in self.walks) - 1

    @property
    def saved(self) -> str:
        """What the first planner saves compared with the second in this search, in per cent."""
        ours, base = (walk.cost for walk in self.walks)
        return f"{100 * (1 - ours / base):.0f} %" if base else "0 %"

    @property
    def mean_saved(self) -> str:
        """What the first planner saves over all searches, in per cent, with its interval."""
        saved = self.walks[0].mean_saved
        value = f"{100 * saved.value:.0f} %"
        if math.isnan(saved.low):
            return value
        return f"{value} ({100 * saved.low:.0f} to {100 * saved.high:.0f})"

    def describe_cost(self, cost: float) -> str:
        """Return a cost with its unit."""
        return f"{cost:.1f} {self.unit}".rstrip()


def replay_page(replay: Replay) -> str:
    """Return the page of a search, open at its start."""
    drawn = {name: getattr(replay, name) for name in ("doors", "holds", "unit")}
    walks = [{"stops": [asdict(stop) for stop in walk.stops]} for walk in replay.walks]
    data = {**drawn, "plan": asdict(replay.plan), "walks": walks}
    return render_page("replay.html.jinja", replay=replay, data=data)
