"""Refusals: a test asserts code and place of an error; what its sentence says is one law."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import PurePath

import pytest

from bsg_data.errors import BSGError

# What was expected or found, or what to do: in words, as an advice behind a semicolon or a dash,
# as a command, or as a question of what was meant.
SAYS_MORE = re.compile(
    r"\b(expected|found|known|give|name|use|run|install)\b|[;?]|`", re.IGNORECASE
)


@contextmanager
def refuses(
    error: type[BSGError], code: str, where: object = None
) -> Iterator[pytest.ExceptionInfo[BSGError]]:
    """Assert that the block raises an error with this code at this place, which its sentence names.

    Args:
        error: its class.
        code: its code.
        where: its place, whole; None if the test does not care.
    """
    with pytest.raises(error) as caught:
        yield caught
    sentence, place = str(caught.value), caught.value.where
    assert caught.value.code == code, sentence
    if where is not None:
        assert place == str(where), sentence
    assert PurePath(place).name in sentence, f"{place} is not named: {sentence}"
    beside = sentence.replace(place if place in sentence else PurePath(place).name, "", 1)
    assert SAYS_MORE.search(beside), f"says neither what was expected nor what to do: {sentence}"
