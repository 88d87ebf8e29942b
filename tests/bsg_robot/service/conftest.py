"""The service, started as people start it."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator

import pytest
from asked_service import start_service


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """The address of a service."""
    with start_service() as (_, found):
        yield found


@pytest.fixture
def own_service() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process and the address of a service that the test may end."""
    with start_service() as started:
        yield started
