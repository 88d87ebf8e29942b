"""Fixtures of the tests of faults: in full or in short, and where the count is kept."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from bench import Bench
from tally import Tally


@pytest.fixture(scope="session")
def full(request: pytest.FixtureRequest) -> bool:
    """Say whether everything is tried (`make faults`), or a sample (`make test`)."""
    return bool(request.config.getoption("--full"))


@pytest.fixture(scope="session")
def tally(request: pytest.FixtureRequest) -> Tally:
    """Return where a test notes what it tried and what survived."""
    path = request.config.getoption("--tally")
    return Tally(None if path is None else Path(path).absolute())


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """Return where commands are tried under faults."""
    tried = Bench(tmp_path_factory.mktemp("bench"))
    yield tried
    tried.close()
