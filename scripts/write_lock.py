"""Write `requirements-*.lock`: what `make` installs, each file by its sha256.

    pip install uv; python scripts/write_lock.py

It takes the versions of `constraints.txt`. One file has what `make demo` needs, the extra `train`;
another has what the tests need besides. Of torch there are two builds, that of the package index
and the one for the processor alone. Each has a file of its own: of two builds in one file pip takes
the one of the index, which brings gigabytes for CUDA.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Collection
from pathlib import Path

import click

REPOSITORY = Path(__file__).parents[1]
HEAD = """\
# {}, on Linux, x86-64, with Python 3.11 or 3.12: every file by its sha256.
# scripts/write_lock.py makes it of the versions in constraints.txt; see docs/design.md.
"""
_COMPILE = (
    *("uv", "pip", "compile", "--generate-hashes", "--no-header", "--no-annotate", "--quiet"),
    *("--no-emit-index-url", "--no-emit-find-links", "--index-strategy", "unsafe-best-match"),
    *("--constraint", "constraints.txt", "--python-version", "3.11"),
)
_PIN = re.compile(r"^(\S+)==\S+ \\\n(?:    --hash=\S+(?: \\)?\n)+", re.MULTILINE)


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--find-links", "folder", help="Folder with a build of torch, as pip is told of it.")
def main(folder: str | None) -> None:
    """Write the locks."""
    links = ("--find-links", folder) if folder else ()
    whole = compile_lock("pyproject.toml", "--extra", "test", *links)
    demo = _PIN.findall(compile_lock("pyproject.toml", "--extra", "train", *links))
    torch, others = split(whole, {"torch"})
    of_demo, of_tests = split(others, demo)
    indexed = compile_lock("-", "--no-deps", given="torch\n")
    for name, what, text in (
        ("torch-cpu", "Torch for the processor alone", torch),
        ("torch", "Torch as the package index has it", indexed),
        ("demo", "What `make demo` installs besides torch", of_demo),
        ("test", "What `make test` adds", of_tests),
    ):
        path = REPOSITORY / f"requirements-{name}.lock"
        path.write_text(HEAD.format(what) + text, "utf-8")


def compile_lock(*words: str, given: str | None = None) -> str:
    """Return the requirements that uv resolves."""
    done = subprocess.run(
        [*_COMPILE, *words], cwd=REPOSITORY, input=given, capture_output=True, text=True, check=True
    )
    return done.stdout


def split(lock: str, names: Collection[str]) -> tuple[str, str]:
    """Return what a lock has of these packages, and the rest."""
    pins = [(pin[1] in names, pin[0]) for pin in _PIN.finditer(lock)]
    return "".join(pin for of, pin in pins if of), "".join(pin for of, pin in pins if not of)


if __name__ == "__main__":
    main()
