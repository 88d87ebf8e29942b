"""Run `bsg-data` in this process."""

from __future__ import annotations

from pathlib import Path

from click.testing import CliRunner, Result

from bsg_cli.data import main


def run(*words: str | Path, code: int = 0) -> Result:
    """Return what the command printed; it must end with this exit code."""
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result
