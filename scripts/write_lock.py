"""Write `requirements.lock`: what `make` installs, each file by its sha256.

    pip install uv; python scripts/write_lock.py

It takes the versions of `constraints.txt`. Of torch there are two builds, that of the package index
and the one for the processor alone, which pip takes where it is offered: both are listed.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import click

REPOSITORY = Path(__file__).parents[1]
LOCK = REPOSITORY / "requirements.lock"
HEAD = """\
# What `make` installs on Linux, x86-64, with Python 3.11 or 3.12: every file by its sha256.
# scripts/write_lock.py makes it of the versions in constraints.txt; see docs/dependencies.md.
"""
_COMPILE = (
    *("uv", "pip", "compile", "--generate-hashes", "--no-header", "--no-annotate", "--quiet"),
    *("--no-emit-index-url", "--no-emit-find-links", "--index-strategy", "unsafe-best-match"),
    *("--constraint", "constraints.txt", "--python-version", "3.11"),
)
_TORCH = re.compile(r"^torch==\S+ \\\n((?:    --hash=\S+(?: \\)?\n)+)", re.MULTILINE)


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--find-links", "folder", help="Folder with a build of torch, as pip is told of it.")
def main(folder: str | None) -> None:
    """Write the lock."""
    links = ("--find-links", folder) if folder else ()
    text = compile_lock("pyproject.toml", "--extra", "test", *links)
    indexed = compile_lock("-", "--no-deps", given="torch\n")
    LOCK.write_text(HEAD + join_torch(text, indexed), "utf-8")


def compile_lock(*words: str, given: str | None = None) -> str:
    """Return the requirements that uv resolves."""
    done = subprocess.run(
        [*_COMPILE, *words], cwd=REPOSITORY, input=given, capture_output=True, text=True, check=True
    )
    return done.stdout


def join_torch(lock: str, indexed: str) -> str:
    """Return a lock that allows torch as it stands there and as the index has it.

    A version without a build, `==2.13.0`, takes a build of it, `2.13.0+cpu`, too.
    """
    hashes = [
        found.strip(" \\")
        for text in (lock, indexed)
        for block in _TORCH.findall(text)
        for found in block.splitlines()
    ]
    version = re.findall(r"^torch==([0-9.]+)", indexed, re.MULTILINE)[0]
    lines = " \\\n    ".join((f"torch=={version}", *sorted(set(hashes))))
    return _TORCH.sub(lambda _: f"{lines}\n", lock)


if __name__ == "__main__":
    main()
