"""Delay signals until work that must not be interrupted is done."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

IN_PLACE = "the new files are in place"
_ENDING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def hold_signals() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM until the block ends; then the first one acts.

    It is for the last steps of a command, in which new files take the place of old ones. These take
    moments, and to undo them would take as long. No signal interrupts other threads than the main
    one, so nothing is delayed there.

    Raises:
        KeyboardInterrupt: after the block, for Ctrl-C; its argument is `IN_PLACE` if the block was
            completed.
    """
    if current_thread() is not main_thread():
        yield
        return
    came: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)

    before = {number: signal.getsignal(number) for number in _ENDING}
    # None is a handler that was not set by Python, which Python could not set again.
    held = {number: handler for number, handler in before.items() if handler is not None}
    completed = False
    try:
        for number in held:
            signal.signal(number, note)
        yield
        completed = True
    finally:
        for number, handler in held.items():
            signal.signal(number, handler)
        if came:
            _act(came[0], completed=completed)


def _act(number: int, *, completed: bool) -> None:
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt as error:
        if completed:
            error.args = (IN_PLACE,)
        raise
