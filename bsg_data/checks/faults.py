"""What `bsg-data check` finds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong with a dataset: where, and what."""

    where: str
    what: str
