"""Run commands in this process."""

from __future__ import annotations

from typing import Protocol

import click
from click.testing import CliRunner, Result


class Run(Protocol):
    """Run a command with these words; it must end with this exit code."""

    def __call__(self, *words: object, code: int = 0, stdin: str | None = None) -> Result: ...


def runner(command: click.Command) -> Run:
    """Return a function that runs a command and returns what it printed."""

    def run(*words: object, code: int = 0, stdin: str | None = None) -> Result:
        done = CliRunner().invoke(command, [str(word) for word in words], input=stdin)
        assert done.exit_code == code, done.output
        return done

    return run
