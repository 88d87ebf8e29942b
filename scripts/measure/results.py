"""Measured tables, and the one JSON that keeps them: docs/results/figures.json."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import date
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Literal

import numpy as np

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import encode_manifest
from bsg_data.files import encode_json, write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_models.evaluation.bootstrap import Estimate

FIGURES = "docs/results/figures.json"
PACKAGES = ("belief-scene-graphs", "torch", "numpy")
# What the measured data did before: nothing, teach the model, or choose a setting of it. Pages
# print all but the first under the table.
TestedOn = Literal["unseen", "training", "chosen"]


@dataclass(frozen=True, slots=True)
class ResultsTable:
    """A table; its first column names the rows, and `reading` says how to read it."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    reading: str = ""
    tested_on: TestedOn = field(kw_only=True)


def write_figures(
    path: Path,
    name: str,
    tables: Sequence[ResultsTable],
    *,
    argv: Sequence[str],
    data: Dataset | None = None,
    files: Sequence[Path] = (),
    packages: Sequence[str] = PACKAGES,
) -> None:
    """Put the tables of one measurement into the JSON that pages, README and cards are made of.

    The other measurements of the file stay as they are.

    Args:
        path: of the JSON.
        name: of the measurement.
        tables: what was measured.
        argv: the command.
        data: dataset that was measured on.
        files: that were measured on instead; with neither, the script makes its own buildings.
        packages: whose versions are noted.
    """
    made = {
        "command": format_command(argv),
        "date": date.today().isoformat(),
        "commit": name_commit(),
        "versions": ", ".join(f"{name} {version(name)}" for name in packages),
    }
    if data is None:
        hashes = [f"{one.name} {hash_file(one)[:16]}" for one in files]
        made["dataset"] = ", ".join(hashes) or "made by the script"
    else:
        totals = data.manifest.totals
        geometry = f" ({totals.placed} with geometry)" if totals.placed else ""
        space, start = data.manifest.class_space.name, hash_unsplit(data)[:16]
        made["dataset"] = f"{totals.scenes} buildings{geometry}, class space {space}, {start}"
    figures = json.loads(path.read_text("utf-8")) if path.exists() else {}
    figures[name] = {
        "made": made,
        "tables": {
            one.title: {
                "reading": one.reading,
                "tested_on": one.tested_on,
                "header": list(one.header),
                "rows": [list(row) for row in one.rows],
            }
            for one in tables
        },
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, (encode_json(figures, indent=1, ensure_ascii=False) + "\n").encode())


def name_commit() -> str:
    """Return the commit that is checked out; a `+` behind it says that its code was changed."""
    commit = _ask_git("rev-parse", "--short=8", "HEAD")
    code = (":(top)", ":(top,exclude)docs/results")
    changed = _ask_git("status", "--porcelain", "--untracked-files=no", "--", *code)
    return f"{commit}+" if changed else commit


def _ask_git(*words: str) -> str:
    done = subprocess.run(
        ["git", *words], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    return done.stdout.strip()


def hash_unsplit(data: Dataset) -> str:
    """Return the sha256 of a dataset's manifest before the split, which identifies its content."""
    return hashlib.sha256(encode_manifest(data.manifest.without_split())).hexdigest()


def format_command(argv: Sequence[str]) -> str:
    """Return a command as a reader types it in a checkout, without the folders of this machine.

    Wherever it wrote, the command writes the JSON of this project.

    >>> format_command(["/srv/scripts/measure/report.py", "labels", "--leaderboard=/srv/board"])
    'python scripts/measure/report.py labels --leaderboard=board'
    >>> format_command(["scripts/measure/speed.py", "--out", "/srv/new.json"])
    'python scripts/measure/speed.py --out docs/results/figures.json'
    """
    parts = PurePath(argv[0]).parts
    start = len(parts) - 1 - [*reversed(parts)].index("scripts") if "scripts" in parts else -1
    said = [_without_folders(before, word) for before, word in pairwise(["", *argv[1:]])]
    return shlex.join(["python", "/".join(parts[start:]), *said])


def _without_folders(before: str, word: str) -> str:
    option, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
    if "--out" in (before, option) and value:
        value = FIGURES
    elif PurePath(value).is_absolute() or value.startswith((os.pardir, "~")):
        value = PurePath(value).name
    return option + equals + value


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
