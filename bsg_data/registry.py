"""Registries: tables of names and the objects that they stand for.

A row names its object as an entry point does, `module:object`, and imports it on first use. So a
command can list the models of the zoo without importing torch. Names without a row are looked up in
the entry points of installed packages. Nothing else can be loaded by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from bsg_data.errors import EXTRA_OF, RecipeError, ask_to_install
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN

Row = TypeVar("Row")


class Registry(Generic[Row]):
    """A table of the rows of one kind, followed by the entry points of one group.

    Attributes:
        kind: what a row is, for error messages, e.g. `planner`.
        group: group of the entry points, e.g. `bsg_models.planners`.

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
        """Return the names of rows and installed entry points, without importing them."""
        return (*self._rows, *(name for name in _installed(self.group) if name not in self._rows))

    def __iter__(self) -> Iterator[str]:
        """Iterate over `names`."""
        return iter(self.names())

    def __contains__(self, name: object) -> bool:
        """Say whether a name is one of `names`."""
        return name in self._rows or name in self.names()

    def __getitem__(self, name: str) -> Row:
        """Import what a name stands for.

        Raises:
            RecipeError: if the name is unknown, or its object cannot be imported or is of another
                type.
        """
        point = self._rows.get(name)
        if point is None:  # what is installed takes long to list
            self.require([name])
            point = _installed(self.group)[name]
        try:
            row = point.load()
        except Exception as error:
            if name not in self._rows:  # a foreign module may raise anything
                raise RecipeError(
                    f"{self.kind} {name!r}: the entry point {point.value} of {self.group} cannot "
                    f"be imported ({error!r}); repair or remove its package",
                    code="entry-point-broken",
                    where=name,
                ) from error
            if not isinstance(error, ModuleNotFoundError):
                raise
            extra = EXTRA_OF.get(str(error.name).partition(".")[0], "all")
            raise RecipeError(
                f"{self.kind} {name!r} needs {error.name}, which is not installed: "
                f"{ask_to_install(extra)}",
                code="library-missing",
                where=name,
            ) from error
        if not isinstance(row, self._row_type):
            raise RecipeError(
                f"{self.kind} {name!r}: {point.value} is a {type(row).__name__}, expected a "
                f"{self._row_type.__name__}",
                code="row-type",
                where=name,
            )
        return row

    def require(self, names: Iterable[str]) -> None:
        """Refuse unknown names as `require_known` does, without importing anything."""
        if unknown := [name for name in names if name not in self]:
            require_known(self.kind, unknown, self.names(), closed=False)

    def package_of(self, name: str) -> str | None:
        """Return the package that brings an installed entry point; None for a row or no name."""
        point = None if name in self._rows else _installed(self.group).get(name)
        return point.dist.name if point is not None and point.dist is not None else None

    def load_all(self) -> tuple[dict[str, Row], list[str]]:
        """Import every row; return the importable rows, and the errors of the others.

        So one broken package does not stop the use of the others.
        """
        rows, faults = {}, []
        for name in self.names():
            try:
                rows[name] = self[name]
            except RecipeError as error:
                faults.append(str(error))
        return rows, faults


def require_known(
    kind: str, names: Iterable[str], known: Iterable[str], *, closed: bool = True
) -> None:
    """Refuse unknown names; unless the list is `closed`, another package may bring one."""
    listed = tuple(known)
    for name in names:
        if name not in listed:
            asked = ask_if_meant(name, listed)
            elsewhere = "" if closed else " If another package brings it, install that."
            hint = f"; {asked}" if asked else f".{elsewhere}"
            raise RecipeError(
                f"no {kind} {name[:SHOWN]!r}{hint} Known are {', '.join(listed)}",
                code="name-unknown",
                where=name[:SHOWN],
            )


@cache
def _installed(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in sorted(entry_points(group=group))}
