"""Execute the tutorials, and write what they print into them.

    python scripts/site/execute.py docs/tutorials/*.md

A tutorial is executed block by block in an empty folder. A block with a title, as
```` ```json title="home.json" ````, is saved as that file. Of a `sh` block, lines that begin with
`bsg-` are run; a `python` block is run whole. A `text` block below shows the output.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import click
from click.testing import CliRunner

from bsg_cli import terminal
from bsg_cli.registry import COMMANDS
from bsg_data.registry import _installed

DOCS = Path(__file__).resolve().parents[2] / "docs"
INSTALL = "pip install -e ."
GIVEN = ("dsg.json",)  # files that a tutorial links to, for they are too long to show
_BLOCK = re.compile(
    r'^```(?P<kind>\w+)(?: title="(?P<title>[^"]+)")?[^\n]*\n(?P<code>.*?)^```\n', re.M | re.S
)
_SECONDS = re.compile(r"(\d epochs in) [\d.,]+ s")
_PRINTED = re.compile(r"\n```text\n.*?^```\n", re.M | re.S)


def execute_page(text: str, folder: Path) -> str:
    """Return a tutorial with what its blocks print when they are executed in a folder.

    Raises:
        ValueError: if a command fails, or a block prints what is not shown.
    """
    parts, end, names = [], 0, {"__name__": "tutorial"}
    with contextlib.chdir(folder), _packages_as_before(folder):
        for block in _BLOCK.finditer(text):
            if block.start() < end:  # what another block printed
                continue
            parts.append(text[end : block.end()])
            end = block.end()
            printed = _execute(block["kind"], block["title"], block["code"], names)
            shown = _PRINTED.match(text, end)
            if shown is not None and block["kind"] in ("sh", "python"):
                parts.append(f"\n```text\n{printed}\n```\n")
                end = shown.end()
            elif block["kind"] == "python" and printed:
                raise ValueError(f"a block prints what is not shown:\n{block['code']}{printed}")
    return "".join([*parts, text[end:]])


@contextlib.contextmanager
def _packages_as_before(folder: Path) -> Iterator[None]:
    """Forget the packages of a folder, which a page has installed, when the page is done."""
    path = list(sys.path)
    try:
        yield
    finally:
        sys.path[:] = path
        for name, module in list(sys.modules.items()):
            if str(getattr(module, "__file__", None) or "").startswith(str(folder.resolve())):
                del sys.modules[name]
        _look_again()


def _execute(kind: str, title: str | None, code: str, names: dict[str, Any]) -> str:
    if title is not None:
        Path(title).parent.mkdir(parents=True, exist_ok=True)
        Path(title).write_text(code, "utf-8")
    elif kind == "sh":
        lines = [line for line in code.splitlines() if line.startswith(("bsg-", INSTALL))]
        return "\n".join(filter(None, map(run_line, lines)))
    elif kind == "python":
        with contextlib.redirect_stdout(io.StringIO()) as said:
            exec(compile(code, "tutorial", "exec"), names)
        return said.getvalue().rstrip()
    return ""


def run_line(line: str) -> str:
    """Run a command in this folder and return what it prints, also on stderr.

    Raises:
        ValueError: if it fails.
    """
    if line == INSTALL:
        return _install()
    name, *words = shlex.split(line, comments=True)
    command = COMMANDS[name]
    with mock.patch.object(terminal, "SECONDS_BETWEEN_LINES", math.inf):  # on slow machines, too
        done = CliRunner().invoke(command, words, default_map=_one_worker(command))
    if done.exit_code:
        raise ValueError(f"{line}: {done.output}")
    return _SECONDS.sub(r"\1 … s", done.output).rstrip()  # machines differ


def _install() -> str:
    """Let the package in this folder be found as an installed one; pip would need a network."""
    # In a process of its own: setuptools changes the level of the root logger for good.
    build = "from setuptools.build_meta import prepare_metadata_for_build_wheel as f; f('.')"
    subprocess.run([sys.executable, "-c", build], check=True, stdout=subprocess.DEVNULL)
    sys.path.insert(0, str(Path.cwd()))
    _look_again()
    return ""


def _look_again() -> None:
    """Have entry points be looked for where packages are now."""
    importlib.invalidate_caches()
    _installed.cache_clear()


def _one_worker(command: click.Command) -> dict[str, Any]:
    """Return defaults that keep a command in this process: what it writes does not depend on it."""
    below = command.commands if isinstance(command, click.Group) else {}
    return {"workers": 1} | {name: _one_worker(sub) for name, sub in below.items()}


@contextlib.contextmanager
def working_folder() -> Iterator[Path]:
    """Yield an empty folder but for the files that a reader is told to download."""
    with tempfile.TemporaryDirectory() as name:
        for given in GIVEN:
            Path(name, given).write_bytes((DOCS / given).read_bytes())
        yield Path(name)


def main(paths: list[str]) -> int:
    """Execute pages; say which changed."""
    os.environ["MPLBACKEND"] = "agg"
    for path in map(Path, paths):
        old = path.read_text("utf-8")
        with working_folder() as folder:
            new = execute_page(old, folder)
        if new != old:
            path.write_text(new, "utf-8")
            print(f"renewed {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
