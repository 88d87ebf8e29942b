"""Pages of measured results: a title, what was found, tables, and how the page was made."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from importlib.metadata import version
from pathlib import Path, PurePath

import numpy as np

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import encode_manifest
from bsg_data.files import write_bytes
from bsg_data.tables import escape_markdown, format_markdown
from bsg_models.evaluation.bootstrap import Estimate

PACKAGES = ("belief-scene-graphs", "torch", "numpy")


@dataclass(frozen=True, slots=True)
class ResultsTable:
    """A table; its first column names the rows, and `reading` says how to read it."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    reading: str = ""

    def lines(self) -> list[str]:
        """Return the table as lines of Markdown."""
        head = [f"## {self.title}", "", self.reading, ""]
        return [*head, *format_markdown(self.rows, header=self.header), ""]


def write_page(
    path: Path,
    title: str,
    tables: Sequence[ResultsTable],
    *,
    argv: Sequence[str],
    found: str = "",
    data: Dataset | None = None,
    packages: Sequence[str] = PACKAGES,
) -> None:
    """Write a page of tables, below the Markdown `found`, and the command that makes it, `argv`."""
    lines = [f"# {title}", "", *([found, ""] if found else [])]
    for table in tables:
        lines += table.lines()
    lines += ["## How it was made", "", "```sh", format_command(argv), "```", ""]
    versions = ", ".join(f"{name} {version(name)}" for name in packages)
    lines += [f"- Date: {date.today().isoformat()}", f"- Versions: {versions}"]
    if data is not None:
        totals = data.manifest.totals
        geometry = f" ({totals.placed} with geometry)" if totals.placed else ""
        space = escape_markdown(data.manifest.class_space.name)
        lines.append(
            f"- Dataset: {totals.scenes} buildings{geometry}, class space {space}, "
            f"`{hash_unsplit(data)[:16]}` (start of the sha256 of `dataset.json` before the split)"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, "\n".join([*lines, ""]).encode())


def hash_unsplit(data: Dataset) -> str:
    """Return the sha256 of a dataset's manifest before the split, which identifies its content."""
    return hashlib.sha256(encode_manifest(data.manifest.without_split())).hexdigest()


def format_command(argv: Sequence[str]) -> str:
    """Return a command as a reader would type it, without the folders of this machine.

    >>> format_command(["/srv/bsg/scripts/measure/report.py", "masks", "--leaderboard=/srv/board"])
    'python scripts/measure/report.py masks --leaderboard=board'
    """
    parts = PurePath(argv[0]).parts
    start = parts.index("scripts") if "scripts" in parts else len(parts) - 1
    return " ".join(["python", "/".join(parts[start:]), *map(_without_folders, argv[1:])])


def _without_folders(word: str) -> str:
    option, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
    if PurePath(value).is_absolute() or value.startswith((os.pardir, "~")):
        value = PurePath(value).name
    word = option + equals + value
    return f"'{word}'" if any(c in word for c in ' *;&|<>()$"') else word


def format_estimate(
    estimate: Estimate, *, digits: int = 4, signed: bool = False, scale: float = 1
) -> str:
    """Return a value with its interval; – if it is not defined.

    >>> format_estimate(Estimate(-0.00123, -0.002, -0.0004, nodes=9), signed=True)
    '-0.0012 (-0.0020 to -0.0004)'
    """
    if np.isnan(estimate.value):
        return "–"
    value, low, high = (
        f"{scale * number:{'+' if signed else ''}.{digits}f}"
        for number in (estimate.value, estimate.low, estimate.high)
    )
    return value if np.isnan(estimate.low) else f"{value} ({low} to {high})"


def is_told_apart(estimate: Estimate) -> bool:
    """Say whether the interval of a difference excludes 0."""
    return bool(estimate.low > 0 or estimate.high < 0)
