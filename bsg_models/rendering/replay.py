"""A search as it went, by two planners side by side: the record, and its page.

The page is `replay.html.jinja` with the record written into it as JSON. Everything that comes from
the data is put on the page as text, never as markup.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bsg_data.files import write_bytes
from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.rendering.pages import render_page
from bsg_models.rendering.plan import Plan


@dataclass(frozen=True, slots=True)
class Stop:
    """A room that a robot is in, and what it knows there.

    Attributes:
        room: 1..R.
        way: rooms that it came through since the stop before, this one last; none at the start.
        cost: travelled so far.
        seen: class → how many of it are in the room: artifacts first, then the most.
        found: artifacts that are in the room.
        presence: `[R]` P(a room holds an artifact that is still sought), 0 for rooms that it has
            entered: what its planner was given here or, once the search is over, was given last.
            None for a planner without a belief.
        target: room where it goes next; None at the end.
        leg: what it costs to go there; None at the end.
    """

    room: int
    way: tuple[int, ...]
    cost: float
    seen: tuple[tuple[str, int], ...]
    found: tuple[str, ...]
    presence: tuple[float, ...] | None
    target: int | None
    leg: float | None


@dataclass(frozen=True, slots=True)
class Walk:
    """A search by one planner, beside all searches of the study by it.

    Attributes:
        planner: its name.
        model: whose beliefs it was given; None for a planner without a belief.
        stops: where it began, then the rooms in the order in which they were entered.
        mean_cost: of all searches.
        mean_entered: rooms, of all searches.
        mean_saved: by all searches, beside `nearest`.
    """

    planner: str
    model: str | None
    stops: tuple[Stop, ...]
    mean_cost: float
    mean_entered: float
    mean_saved: Estimate

    @property
    def cost(self) -> float:
        """Of the whole search."""
        return self.stops[-1].cost


@dataclass(frozen=True, slots=True)
class Replay:
    """One search by one planner or by several: same start, artifacts and costs.

    Attributes:
        scene_id: of the building.
        episode: number of the search in its building.
        artifacts: names of the classes that are sought.
        task: when the search ends, `single` or `all`.
        world: whose costs it travels at.
        unit: of costs, `m`; empty where they are drawn.
        plan: of the rooms that can be reached.
        doors: pairs of rooms that connect; none where costs are drawn.
        holds: rooms that hold an artifact, which no robot knows.
        left_out: number of the rooms that cannot be reached, which are not drawn.
        walks: the planner's, then that of what it is compared with.
        searches: of the study, in this world and task.
        buildings: of the same.
        chosen: how this search came to be shown, in a sentence or two.
    """

    scene_id: str
    episode: int
    artifacts: tuple[str, ...]
    task: str
    world: str
    unit: str
    plan: Plan
    doors: tuple[tuple[int, int], ...]
    holds: tuple[int, ...]
    left_out: int
    walks: tuple[Walk, ...]
    searches: int
    buildings: int
    chosen: str

    @property
    def steps(self) -> int:
        """Rooms that the robot enters which enters the most."""
        return max(len(walk.stops) for walk in self.walks) - 1

    @property
    def saved(self) -> str:
        """What the first planner saves beside the second in this search, in per cent."""
        ours, base = (walk.cost for walk in self.walks)
        return f"{100 * (1 - ours / base):.0f} %" if base else "0 %"

    @property
    def mean_saved(self) -> str:
        """What the first planner saves in all searches, in per cent with its interval."""
        return describe_saving(self.walks[0].mean_saved)

    def describe_cost(self, cost: float) -> str:
        """Return a cost with its unit."""
        return f"{cost:.1f} {self.unit}".rstrip()


def write_replay(replay: Replay, path: Path) -> None:
    """Write the page, whole or not at all."""
    write_bytes(path, replay_page(replay).encode())


def replay_page(replay: Replay) -> str:
    """Return the page of a search, open at its start."""
    return render_page("replay.html.jinja", replay=replay, data=_plain(asdict(replay)))


def describe_share(share: float) -> str:
    """Return a probability in per cent, whole ones; 0 and 100 only for exactly that.

    >>> describe_share(0.004), describe_share(0.42), describe_share(0.999)
    ('< 1 %', '42 %', '> 99 %')
    """
    if 0 < share < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 < share < 1 else f"{100 * share:.0f} %"


def describe_saving(saved: Estimate) -> str:
    """Return a saving in per cent with its interval, if there is one.

    >>> describe_saving(Estimate(0.4321, float("nan"), float("nan"), 10))
    '43 %'
    """
    if math.isnan(saved.low):
        return f"{100 * saved.value:.0f} %"
    return f"{100 * saved.value:.0f} % ({100 * saved.low:.0f} to {100 * saved.high:.0f})"


def _plain(value: Any) -> Any:
    """Return nested values for JSON: tuples are lists, what is not known is null."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and math.isnan(value) else value
