"""List all planners: each name stands for a function that chooses the next room.

The table holds names only, so a command can list them without importing NumPy. Packages add rows
with entry points of the group `bsg_models.planners`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

from bsg_data.errors import RecipeError
from bsg_data.registry import Registry

if TYPE_CHECKING:  # the table needs no NumPy
    from bsg_data.arrays import Ints
    from bsg_models.search.knowledge import Knowledge

Reads = Literal["none", "belief", "truth"]


@dataclass(frozen=True, slots=True)
class Planner:
    """A rule for the next room.

    Attributes:
        choose: function of `Knowledge` of E searches at once; returns an unexplored room for each,
            `[E]`. The docs show the first line of its docstring.
        reads: which presence it receives: none (`none`), the model's (`belief`), or the true one
            (`truth`). `Knowledge` holds nothing else about where things are.
        so_that: its advantage, for the docs.
    """

    choose: Callable[[Knowledge], Ints]
    reads: Reads = "belief"
    so_that: str = "–"


# What can be given as a planner: a name of the table, a planner, or its function.
AnyPlanner: TypeAlias = "str | Planner | Callable[[Knowledge], Ints]"

_HERE = "bsg_models.search.planners:"
PLANNERS: Registry[Planner] = Registry(
    "planner",
    Planner,
    group="bsg_models.planners",
    rows={
        "nearest": _HERE + "NEAREST",
        "greedy-share": _HERE + "GREEDY_SHARE",
        "greedy-belief": _HERE + "GREEDY_BELIEF",
        "ratio": _HERE + "RATIO",
        "expected-cost": _HERE + "EXPECTED_COST",
        "routing": _HERE + "ROUTING",
        "oracle": _HERE + "ORACLE",
    },
)


def find_planner(planner: AnyPlanner) -> Planner:
    """Return the planner for a name, a planner or a function.

    A bare function may read the belief; `Planner(function, reads="none")` says that it does not.
    """
    if isinstance(planner, str):
        return PLANNERS[planner]
    if isinstance(planner, Planner):
        return planner
    if callable(planner):
        return Planner(planner)
    raise RecipeError(
        f"planner {planner!r}: expected a name, a Planner or a function of Knowledge",
        code="planner-unknown",
        where=repr(planner),
    )
