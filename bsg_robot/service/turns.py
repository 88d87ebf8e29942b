"""Who is answered next: the client whose questions took least lately, however many it asks."""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import anyio

_HALF_LIFE = 20.0  # seconds after which what a client's questions took counts half
_LONG = 2.0  # seconds that make a question a long one
_MOST_KNOWN = 1_000  # clients whose questions are remembered


@dataclass(eq=False)
class _Turn:
    is_long: bool
    has_come: anyio.Event = field(default_factory=anyio.Event)


@dataclass(frozen=True)
class _Taken:
    """Seconds that a client's questions took lately: all together, and the longest."""

    all: float = 0.0
    longest: float = 0.0
    at: float = 0.0  # when that was so

    def count(self, seconds: float) -> _Taken:
        """Count a question more."""
        now = anyio.current_time()
        left = 0.5 ** ((now - self.at) / _HALF_LIFE)
        return _Taken(self.all * left + seconds, max(self.longest * left, seconds), now)


class Turns:
    """As many questions at a time as there are processes; one is kept free of long ones.

    These are large ones, and all of a client that asked a long one lately.
    """

    def __init__(self, number: int) -> None:
        self._free, self._free_for_long = number, number - 1
        # Client → its questions; of those whose took alike, who was last served is the last.
        self._waiting: dict[str, deque[_Turn]] = {}
        self._taken: dict[str, _Taken] = {}  # who was last served is the last

    @asynccontextmanager
    async def take(self, client: str, *, is_large: bool) -> AsyncIterator[None]:
        """Wait for a turn, and hold it within the block."""
        turn = _Turn(is_large)
        self._waiting.setdefault(client, deque()).append(turn)
        self._admit()
        began = anyio.current_time()
        try:
            await turn.has_come.wait()
            began = anyio.current_time()
            yield
        finally:
            if turn.has_come.is_set():
                self._free, self._free_for_long = self._free + 1, self._free_for_long + turn.is_long
                self._count(client, anyio.current_time() - began)
                self._admit()
            else:
                self._remove(client, turn)

    def _count(self, client: str, seconds: float) -> None:
        self._taken[client] = self._taken.pop(client, _Taken()).count(seconds)
        if len(self._taken) > _MOST_KNOWN:
            del self._taken[next(iter(self._taken))]

    def _admit(self) -> None:
        while self._free and (found := self._find_next()):
            client, turn = found
            self._remove(client, turn)
            if client in self._waiting:  # behind the others
                self._waiting[client] = self._waiting.pop(client)
            self._free, self._free_for_long = self._free - 1, self._free_for_long - turn.is_long
            turn.has_come.set()

    def _find_next(self) -> tuple[str, _Turn] | None:
        taken = {one: self._taken.get(one, _Taken()).count(0.0) for one in self._waiting}
        for client in sorted(taken, key=lambda one: taken[one].all):
            for turn in self._waiting[client]:
                is_long = turn.is_long or taken[client].longest > _LONG
                if self._free_for_long or not is_long:
                    turn.is_long = is_long
                    return client, turn
        return None

    def _remove(self, client: str, turn: _Turn) -> None:
        self._waiting[client].remove(turn)
        if not self._waiting[client]:
            del self._waiting[client]
