"""Records of the faults that `bsg-data check` finds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

_NAMED = 3  # rows named for each fault; the others are counted


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault of a dataset: where it is, and what is wrong."""

    where: str
    what: str


class ObjectFaults:
    """Faults of objects: the first of each kind are named, the others counted."""

    def __init__(self) -> None:
        """Start without faults."""
        self._named: dict[str, list[str]] = {}
        self._times: Counter[str] = Counter()

    def add(self, what: str, names: Iterable[str], *, times: int) -> None:
        """Add the objects with one fault: the names of the first, and the number of all."""
        named = self._named.setdefault(what, [])
        named += list(names)[: _NAMED - len(named)]
        self._times[what] += times

    def __iter__(self) -> Iterator[Fault]:
        """Yield the faults, kind by kind."""
        for what, names in self._named.items():
            yield from (Fault("objects", f"{name}: {what}") for name in names)
            if self._times[what] > len(names):
                yield Fault("objects", f"… and {self._times[what] - len(names)} more: {what}")
