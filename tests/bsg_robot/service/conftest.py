"""The service, started as people start it."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from bsg_models.runs.found_model import TERMS

COMMAND = (sys.executable, "-c", "from bsg_cli.serve import main; main()")


@contextmanager
def _serve() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the service on a free port of this machine; it ends as it should."""
    with subprocess.Popen([*COMMAND, "--port", "0"], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        try:
            assert process.stderr.readline() == f"{TERMS}\n"
            found = re.search(r"http://127\.0\.0\.1:\d+", process.stderr.readline())
            assert found
            yield process, found[0]
        finally:
            process.terminate()
            notes = process.stderr.read()
    assert (process.returncode, notes.strip()) == (143, "asked to end")


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """The address of a service."""
    with _serve() as (_, found):
        yield found


@pytest.fixture
def own_service() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process and the address of a service that the test may end."""
    with _serve() as started:
        yield started
