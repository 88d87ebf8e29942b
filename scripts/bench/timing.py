"""What one benchmark found: our time beside that of something else, and the target.

Every benchmark of this folder yields records of `Speed` from its `measure(hm3d)`, with the folder
of HM3D's annotations or None for synthetic buildings. `speed.py` runs all.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

HEADER = ("work", "compared with", "ours", "theirs", "ratio", "target", "met")


@dataclass(frozen=True, slots=True)
class Speed:
    """What the same work takes here and elsewhere, measured in one run.

    Attributes:
        what: the work, as in "100 draws of 145 buildings".
        against: what it is compared with; "" for a target in seconds.
        ours_s: seconds that we take.
        theirs_s: seconds of what it is compared with; None for a target in seconds.
        target: of `ratio`; in seconds, if there is nothing to compare with.
        at_least: whether the target is how many times as fast we should be at least; otherwise it
            is how many times as long we may take at most.
        kind: what it is compared with: what people would `use` instead, itself with less data
            (`growth`), or a part of the work alone (`bound`).
    """

    what: str
    against: str
    ours_s: float
    theirs_s: float | None
    target: float
    at_least: bool = False
    kind: Literal["use", "growth", "bound"] = "use"

    @property
    def ratio(self) -> float | None:
        """How many times as fast we are under `at_least`, else how many times as long we take.

        >>> Speed("a", "b", ours_s=1, theirs_s=4, target=3, at_least=True).ratio
        4.0
        >>> Speed("a", "b", ours_s=1, theirs_s=4, target=3).ratio
        0.25
        """
        if self.theirs_s is None:
            return None
        return self.theirs_s / self.ours_s if self.at_least else self.ours_s / self.theirs_s

    @property
    def is_met(self) -> bool:
        """Whether the target was met."""
        found = self.ours_s if self.ratio is None else self.ratio
        return found >= self.target if self.at_least else found <= self.target

    def cells(self) -> tuple[str, ...]:
        """Return the cells of a row under `HEADER`.

        >>> Speed("a step", "an MLP", ours_s=0.0021, theirs_s=0.001, target=2.5).cells()
        ('a step', 'an MLP', '2.10 ms', '1.00 ms', '2.1 ×', '≤ 2.5 ×', 'met')
        """
        target = format_seconds(self.target) if self.ratio is None else f"{self.target:g} ×"
        return (
            self.what,
            self.against or "–",
            format_seconds(self.ours_s),
            "–" if self.theirs_s is None else format_seconds(self.theirs_s),
            "–" if self.ratio is None else f"{self.ratio:.3g} ×",
            f"{'≥' if self.at_least else '≤'} {target}",
            "met" if self.is_met else "missed",
        )


def format_seconds(seconds: float) -> str:
    """Return seconds with three digits, in the unit that suits them.

    >>> [format_seconds(s) for s in (412.0, 1.5, 0.05, 0.00093, 0.0000042)]
    ['412 s', '1.50 s', '50.0 ms', '930 µs', '4.20 µs']
    """
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size or unit == "µs":
            break
    value = seconds / size
    digits = 2 if value < 10 else 1 if value < 100 else 0
    return f"{value:.{digits}f} {unit}"


def time_both(
    ours: Callable[[], object],
    theirs: Callable[[], object],
    *,
    repeats: int = 5,
    clock: Callable[[], float] = time.process_time,
) -> tuple[float, float]:
    """Return the least seconds of each of two calls, which take turns.

    They are seconds of processor; give `time.perf_counter` for work of several processes.
    """
    taken: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        for call, seconds in zip((ours, theirs), taken, strict=True):
            began = clock()
            call()
            seconds.append(clock() - began)
    return min(taken[0]), min(taken[1])
