"""Write `requirements*.lock`: what `make` installs, each file by its sha256.

    pip install uv; python scripts/write_lock.py

It takes the versions of `constraints.txt`. Of torch there are two builds, that of the package index
and the one for the processor alone. Each has a file of its own: of two builds in one file pip takes
the one of the index, which brings gigabytes for CUDA.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import click

REPOSITORY = Path(__file__).parents[1]
LOCK = REPOSITORY / "requirements.lock"
CPU_TORCH = REPOSITORY / "requirements-torch-cpu.lock"
TORCH = REPOSITORY / "requirements-torch.lock"
HEAD = """\
# What `make` installs on Linux, x86-64, with Python 3.11 or 3.12: every file by its sha256.
# scripts/write_lock.py makes it of the versions in constraints.txt; see docs/design.md.
"""
_COMPILE = (
    *("uv", "pip", "compile", "--generate-hashes", "--no-header", "--no-annotate", "--quiet"),
    *("--no-emit-index-url", "--no-emit-find-links", "--index-strategy", "unsafe-best-match"),
    *("--constraint", "constraints.txt", "--python-version", "3.11"),
)
_TORCH = re.compile(r"^torch==\S+ \\\n(?:    --hash=\S+(?: \\)?\n)+", re.MULTILINE)


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--find-links", "folder", help="Folder with a build of torch, as pip is told of it.")
def main(folder: str | None) -> None:
    """Write the lock."""
    links = ("--find-links", folder) if folder else ()
    text = compile_lock("pyproject.toml", "--extra", "test", *links)
    rest, torch = split_torch(text)
    indexed = compile_lock("-", "--no-deps", given="torch\n")
    said = "by its sha256; see requirements.lock.\n"
    LOCK.write_text(HEAD + rest, "utf-8")
    CPU_TORCH.write_text(f"# torch for the processor alone, {said}{torch}", "utf-8")
    TORCH.write_text(f"# torch as the package index has it, {said}{indexed}", "utf-8")


def compile_lock(*words: str, given: str | None = None) -> str:
    """Return the requirements that uv resolves."""
    done = subprocess.run(
        [*_COMPILE, *words], cwd=REPOSITORY, input=given, capture_output=True, text=True, check=True
    )
    return done.stdout


def split_torch(lock: str) -> tuple[str, str]:
    """Return what a lock has besides torch, and torch."""
    return _TORCH.sub("", lock), "".join(_TORCH.findall(lock))


if __name__ == "__main__":
    main()
