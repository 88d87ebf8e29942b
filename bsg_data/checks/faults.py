"""What `bsg-data check` finds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

_NAMED = 3  # rows with one fault that are named; the rest are counted


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong with a dataset: where, and what."""

    where: str
    what: str


class ObjectFaults:
    """Faults that many objects may have: the first of each kind are named, the rest counted."""

    def __init__(self) -> None:
        """Begin with none."""
        self._named: dict[str, list[str]] = {}
        self._times: Counter[str] = Counter()

    def add(self, what: str, names: Iterable[str], *, times: int) -> None:
        """Add objects with one fault, of which the first are named, in their order."""
        named = self._named.setdefault(what, [])
        named += list(names)[: _NAMED - len(named)]
        self._times[what] += times

    def __iter__(self) -> Iterator[Fault]:
        """Yield the faults, kind by kind."""
        for what, names in self._named.items():
            yield from (Fault("objects", f"{name}: {what}") for name in names)
            if self._times[what] > len(names):
                yield Fault("objects", f"… and {self._times[what] - len(names)} more: {what}")
