"""All planners on one screen: a name stands for a function that chooses the next room.

The table holds names alone, so that a command can list them without importing numba. A package of
somebody else adds rows by the entry points of the group `bsg_models.planners`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

from bsg_data.errors import RecipeError
from bsg_data.registry import Registry

if TYPE_CHECKING:  # the table needs no NumPy
    from bsg_models.search.knowledge import Knowledge
    from bsg_models.search.shortest_paths import Ints

Reads = Literal["none", "belief", "truth"]


@dataclass(frozen=True, slots=True)
class Planner:
    """A rule for the next room.

    Attributes:
        choose: function of `Knowledge` of E searches at once that returns an unexplored room for
            each, `[E]`; the first line of its docstring stands in the docs.
        reads: whose presence it is given: nobody's (`none`), the model's (`belief`), or what is
            really there (`truth`). `Knowledge` holds nothing else about where things are.
        so_that: what is gained by it, for the docs.
        shares: whether it looks at `Knowledge.share`, which costs several times what a presence
            does; without, it is given none.
        most_rooms: of a building that a study asks it about, as it takes too long in more; None for
            any number.
    """

    choose: Callable[[Knowledge], Ints]
    reads: Reads = "belief"
    so_that: str = "–"
    shares: bool = True
    most_rooms: int | None = None


# What may stand where a planner is asked for: a name of the table, a planner, or its function.
AnyPlanner: TypeAlias = "str | Planner | Callable[[Knowledge], Ints]"

_HERE = "bsg_models.search.planners:"
PLANNERS: Registry[Planner] = Registry(
    "planner",
    Planner,
    group="bsg_models.planners",
    rows={
        "nearest": _HERE + "NEAREST",
        "random": _HERE + "RANDOM",
        "greedy-share": _HERE + "GREEDY_SHARE",
        "greedy-belief": _HERE + "GREEDY_BELIEF",
        "ratio": _HERE + "RATIO",
        "expected-cost": _HERE + "EXPECTED_COST",
        "routing": _HERE + "ROUTING",
        "oracle": _HERE + "ORACLE",
    },
)


def find_planner(planner: AnyPlanner) -> Planner:
    """Return the planner that a name, a planner or a function stands for.

    A bare function may read the belief; `Planner(function, reads="none")` says that it does not.

    Raises:
        RecipeError: for a name that nobody knows, and for what is neither.
    """
    if isinstance(planner, str):
        return PLANNERS[planner]
    if isinstance(planner, Planner):
        return planner
    if callable(planner):
        return Planner(planner)
    raise RecipeError(f"planner {planner!r}: expected a name, a Planner or a function of Knowledge")
