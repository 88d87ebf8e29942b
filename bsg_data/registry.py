"""Registries: names and what they stand for, in one literal table each.

A row names an object as an entry point does, `module:object`, and is imported when it is asked for:
a command can list the models of the zoo without importing torch. A name that is no row is looked up
in the entry points of the packages that are installed. Nothing else can be loaded by a name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from bsg_data.errors import RecipeError
from bsg_data.spelling import SHOWN, ask_if_meant

Row = TypeVar("Row")


class Registry(Generic[Row]):
    """Rows of one kind by name, then the entry points of one group.

    Attributes:
        kind: what a row is, in the words of an error: `planner`.
        group: of the entry points, e.g. `bsg_models.planners`.

    >>> numbers = Registry("number", int, group="bsg_data.numbers", rows={"pi": "math:pi"})
    >>> numbers.names()
    ('pi',)
    """

    def __init__(
        self, kind: str, row_type: type[Row], *, group: str, rows: Mapping[str, str]
    ) -> None:
        self.kind, self.group = kind, group
        self._row_type = row_type
        self._rows = {name: EntryPoint(name, target, group) for name, target in rows.items()}

    def names(self) -> tuple[str, ...]:
        """Return the names of the rows, then those of installed entry points; imports none."""
        return (*self._rows, *(name for name in _installed(self.group) if name not in self._rows))

    def __iter__(self) -> Iterator[str]:
        """Iterate over `names`."""
        return iter(self.names())

    def __contains__(self, name: object) -> bool:
        """Say whether a name is a row or an installed entry point."""
        return name in self._rows or name in _installed(self.group)

    def __getitem__(self, name: str) -> Row:
        """Import what a name stands for.

        Raises:
            RecipeError: for a name that nobody knows, with the nearest; for an entry point that
                cannot be imported or is no such row.
        """
        self.require([name])
        point = self._rows.get(name) or _installed(self.group)[name]
        try:
            row = point.load()
        except Exception as error:
            if name not in self._rows:  # somebody else's module raises what it likes
                raise RecipeError(
                    f"{self.kind} {name!r}: the entry point {point.value} of {self.group} cannot "
                    f"be imported ({error!r})"
                ) from error
            if not isinstance(error, ModuleNotFoundError):
                raise
            raise RecipeError(
                f"{self.kind} {name!r} needs {error.name}, which is not installed; "
                "pip install 'belief-scene-graphs[all]' has what rows of this project need"
            ) from error
        if not isinstance(row, self._row_type):
            raise RecipeError(
                f"{self.kind} {name!r}: {point.value} is a {type(row).__name__}, expected a "
                f"{self._row_type.__name__}"
            )
        return row

    def require(self, names: Iterable[str]) -> None:
        """Refuse names that nobody knows; imports none.

        Raises:
            RecipeError: for the first such name, with the nearest that is known.
        """
        require_known(self.kind, names, self.names())

    def load_all(self) -> tuple[dict[str, Row], list[str]]:
        """Import every row; return those that can be, and what is wrong with the others.

        A broken package of somebody else does not keep the rest from being used.
        """
        rows, faults = {}, []
        for name in self.names():
            try:
                rows[name] = self[name]
            except RecipeError as error:
                faults.append(str(error))
        return rows, faults


def require_known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a name that is not known.

    Raises:
        RecipeError: for the first such name, with the nearest that is known.
    """
    listed = tuple(known)
    for name in names:
        if name not in listed:
            asked = ask_if_meant(name, listed)
            hint = f"; {asked}" if asked else "."
            raise RecipeError(f"no {kind} {name[:SHOWN]!r}{hint} Known are {', '.join(listed)}")


@cache
def _installed(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in sorted(entry_points(group=group))}
