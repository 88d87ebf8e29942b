"""Record a search by two planners side by side, and write its page.

`replay.html.jinja` is filled with the record as JSON. Everything that comes from the data is put on
the page as text, never as markup.
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
    """One room of a robot's route, and what the robot knows there.

    Attributes:
        room: 1..R.
        way: rooms passed since the previous stop, this room last; empty at the start.
        cost: travelled so far.
        seen: (class, number in the room): artifacts first, then the most frequent.
        found: artifacts that are in the room.
        presence: `[R]` P(a room holds an artifact that is still sought), 0 for entered rooms. It is
            what the planner received here; once the search is over, what it received last. None
            for a planner without a belief.
        target: next room; None at the end.
        leg: cost of the way to `target`; None at the end.
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
    """One search by one planner, with the means over all searches of the study.

    Attributes:
        planner: its name.
        model: whose beliefs it received; None for a planner without a belief.
        stops: the start, then the rooms in the order entered.
        mean_cost: over all searches.
        mean_entered: rooms, over all searches.
        mean_saved: saving over all searches, compared with `nearest`.
    """

    planner: str
    model: str | None
    stops: tuple[Stop, ...]
    mean_cost: float
    mean_entered: float
    mean_saved: Estimate

    @property
    def cost(self) -> float:
        """Cost of the whole search."""
        return self.stops[-1].cost


@dataclass(frozen=True, slots=True)
class Replay:
    """One search by one or several planners: same start, artifacts and costs.

    Attributes:
        scene_id: of the building.
        episode: number of the search in its building.
        artifacts: names of the classes that are sought.
        task: when the search ends, `single` or `all`.
        world: name of the world, which sets the costs.
        unit: of costs, `m`; empty if costs are drawn at random.
        plan: of the rooms that can be reached.
        doors: pairs of connected rooms; empty if costs are drawn at random.
        holds: rooms that hold an artifact (no robot knows them).
        left_out: number of rooms that cannot be reached; they are not drawn.
        walks: the planner's, then those it is compared with.
        searches: number in the study, in this world and task.
        buildings: number in the study, in this world and task.
        chosen: why this search is shown, in a sentence or two.
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
        return describe_saving(self.walks[0].mean_saved)

    def describe_cost(self, cost: float) -> str:
        """Return a cost with its unit."""
        return f"{cost:.1f} {self.unit}".rstrip()


def write_replay(replay: Replay, path: Path) -> None:
    """Write the replay page of a search. A failed write leaves no partial file."""
    write_bytes(path, replay_page(replay).encode())


def replay_page(replay: Replay) -> str:
    """Return the page of a search, open at its start."""
    return render_page("replay.html.jinja", replay=replay, data=_plain(asdict(replay)))


def describe_share(share: float) -> str:
    """Format a probability in whole per cent; only exact 0 and 1 become 0 % and 100 %.

    >>> describe_share(0.004), describe_share(0.42), describe_share(0.999)
    ('< 1 %', '42 %', '> 99 %')
    """
    if 0 < share < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 < share < 1 else f"{100 * share:.0f} %"


def describe_saving(saved: Estimate) -> str:
    """Format a saving in per cent, with its interval if there is one.

    >>> describe_saving(Estimate(0.4321, float("nan"), float("nan"), 10))
    '43 %'
    """
    if math.isnan(saved.low):
        return f"{100 * saved.value:.0f} %"
    return f"{100 * saved.value:.0f} % ({100 * saved.low:.0f} to {100 * saved.high:.0f})"


def _plain(value: Any) -> Any:
    """Return nested values for JSON: tuples become lists, unknown values null."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and math.isnan(value) else value
