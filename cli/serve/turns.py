"""Who is answered next: clients take turns, however many questions each of them asks."""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import anyio


@dataclass(frozen=True, eq=False)
class _Turn:
    is_large: bool
    has_come: anyio.Event = field(default_factory=anyio.Event)


class Turns:
    """As many questions at a time as there are processes; one is kept free of large ones."""

    def __init__(self, number: int) -> None:
        self._free, self._free_for_large = number, number - 1
        # Client → its questions; who was last served is the last.
        self._waiting: dict[str, deque[_Turn]] = {}

    @asynccontextmanager
    async def take(self, client: str, *, is_large: bool) -> AsyncIterator[None]:
        """Wait for a turn, and hold it within the block."""
        turn = _Turn(is_large)
        self._waiting.setdefault(client, deque()).append(turn)
        self._admit()
        try:
            await turn.has_come.wait()
            yield
        finally:
            if turn.has_come.is_set():
                self._free, self._free_for_large = self._free + 1, self._free_for_large + is_large
                self._admit()
            else:
                self._remove(client, turn)

    def _admit(self) -> None:
        while self._free and (found := self._find_next()):
            client, turn = found
            self._remove(client, turn)
            if client in self._waiting:  # behind the others
                self._waiting[client] = self._waiting.pop(client)
            self._free, self._free_for_large = self._free - 1, self._free_for_large - turn.is_large
            turn.has_come.set()

    def _find_next(self) -> tuple[str, _Turn] | None:
        for client, turns in self._waiting.items():
            for turn in turns:
                if self._free_for_large or not turn.is_large:
                    return client, turn
        return None

    def _remove(self, client: str, turn: _Turn) -> None:
        self._waiting[client].remove(turn)
        if not self._waiting[client]:
            del self._waiting[client]
