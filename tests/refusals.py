"""Refusals: a test asserts the code and the place of an error; one golden file holds all sentences.

`make sentences` writes `tests/refusals.txt` anew; read its difference as a reader of the messages
would.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

from bsg_data.errors import BSGError

GOLDEN = Path(__file__).with_suffix(".txt")
SEEN: set[str] = set()  # what this run met; conftest writes it under --sentences


@contextmanager
def refuses(
    error: type[BSGError], code: str, where: object = None, *, golden: bool = True
) -> Iterator[pytest.ExceptionInfo[BSGError]]:
    """Assert that the block raises an error with this code at this place.

    Args:
        error: its class.
        code: its code.
        where: its place, whole; None if the test does not care.
        golden: whether its sentence is kept; not if it depends on chance.
    """
    with pytest.raises(error) as caught:
        yield caught
    assert caught.value.code == code, str(caught.value)
    if where is not None:
        assert caught.value.where == str(where), str(caught.value)
    if golden:
        line = f"{code}: {_without_folders(str(caught.value))}"
        SEEN.add(line)
        assert line in _sentences() or not _sentences(), f"a new sentence: {line}"


def _without_folders(text: str) -> str:
    """Return a message without what depends on the run: folders, hashes and line breaks."""
    text = re.sub(r"(?:/[^\s/:,;'\"()]+)+/", "", text)
    text = re.sub(r"\btest_\w{1,30}\d+\b", "FOLDER", text)  # of pytest, for this test
    return re.sub(r"\b[0-9a-f]{12,64}\b", "HASH", text).replace("\n", " ⏎ ")


@cache
def _sentences() -> frozenset[str]:
    """Return the golden sentences; none while they are written."""
    return frozenset(GOLDEN.read_text("utf-8").splitlines()) if GOLDEN.exists() else frozenset()
