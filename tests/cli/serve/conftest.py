"""The service, started as people start it."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator

import pytest

COMMAND = (sys.executable, "-c", "from bsg_cli.serve import main; main()")


@pytest.fixture(scope="session")
def address() -> Iterator[str]:
    """The address of a service that runs on a free port of this machine; it ends as it should."""
    with subprocess.Popen([*COMMAND, "--port", "0"], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        try:
            found = re.search(r"http://127\.0\.0\.1:\d+", process.stderr.readline())
            assert found
            yield found[0]
        finally:
            process.terminate()
            said = process.stderr.read()
    assert (process.returncode, said.strip()) == (143, "asked to end")
