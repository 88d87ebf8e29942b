"""What a test of faults tried and what survived, kept for docs/results/reliability.md."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class Trial:
    """One row of the table: what was tried on one command or reader.

    Attributes:
        test: what was done, in a few words; rows of one test stand together.
        command: the command or the reader that it was done to.
        tried: number of tries.
        survived: those that ended as they must.
        misses: the others, each in a sentence.
    """

    test: str
    command: str
    tried: int
    survived: int
    misses: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tally:
    """Append trials to a file, one JSON line each; without a file they are forgotten."""

    path: Path | None

    def __call__(
        self, *, test: str, command: str, tried: int, survived: int, misses: Sequence[str] = ()
    ) -> None:
        """Note a trial. It is called before the test asserts, so that misses are noted, too."""
        if self.path is None:
            return
        line = json.dumps(asdict(Trial(test, command, tried, survived, tuple(misses)))) + "\n"
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        try:
            os.write(descriptor, line.encode())  # in one call: test processes write side by side
        finally:
            os.close(descriptor)
