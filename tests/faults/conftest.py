"""What all tests of faults share."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def full(request: pytest.FixtureRequest) -> bool:
    """Say whether everything is tried (`make faults`), or a sample (`make test`)."""
    return bool(request.config.getoption("--full"))
