"""Delay signals until work that must not be interrupted is done."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
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
    with ExitStack() as stack:
        stack.callback(lambda: _act(came, completed=completed))
        for number, handler in held.items():  # each is restored, whatever happens at the others
            stack.callback(signal.signal, number, handler)
            signal.signal(number, note)
        yield
        completed = True


def _act(came: Sequence[int], *, completed: bool) -> None:
    """Let the first signal that came act now, if any did."""
    try:
        for number in came[:1]:
            signal.raise_signal(number)
    except KeyboardInterrupt as error:
        if completed:
            error.args = (IN_PLACE,)
        raise
