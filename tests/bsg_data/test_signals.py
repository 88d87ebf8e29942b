"""Signals wait for the end of a block, by hand."""

from __future__ import annotations

import signal
from contextlib import nullcontext
from threading import Thread

import pytest

from bsg_data.signals import IN_PLACE, hold_signals


def interrupt(done: list[str], *, inner: bool = False) -> None:
    with hold_signals():
        with hold_signals() if inner else nullcontext():
            signal.raise_signal(signal.SIGINT)
        done.append("after the signal")


def test_ctrl_c_waits_until_the_block_is_left() -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        interrupt(done)
    assert done == ["after the signal"]


def test_the_first_of_several_signals_acts() -> None:
    came: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: came.append(number))
    try:
        with hold_signals():
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGINT)
            assert came == []
    finally:
        signal.signal(signal.SIGTERM, before)
    assert came == [signal.SIGTERM]


def test_blocks_within_blocks_wait_for_the_outermost() -> None:
    done: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        interrupt(done, inner=True)
    assert done == ["after the signal"]


def test_the_interrupt_says_that_the_block_was_completed() -> None:
    with pytest.raises(KeyboardInterrupt, match=IN_PLACE):
        interrupt([])
    with pytest.raises(KeyboardInterrupt) as caught:
        fail_interrupted()
    assert caught.value.args == ()


def fail_interrupted() -> None:
    with hold_signals():
        signal.raise_signal(signal.SIGINT)
        raise OSError("the disk is gone")


def test_an_error_comes_before_a_signal_and_is_kept_as_its_context() -> None:
    with pytest.raises(KeyboardInterrupt) as caught:
        fail_interrupted()
    assert isinstance(caught.value.__context__, OSError)


def test_handlers_are_those_of_before() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with hold_signals():
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before


def test_other_threads_hold_nothing() -> None:
    entered = []

    def work() -> None:
        with hold_signals():
            entered.append(True)

    thread = Thread(target=work)
    thread.start()
    thread.join()
    assert entered == [True]
