"""Write a page of measured results as Markdown.

A page has a title, the conclusions, the tables, and "How it was made": the command, the date, the
versions, and the dataset or the machine.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path, PurePath

import numpy as np
import torch
from fold_models import hash_unsplit

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import write_bytes
from bsg_data.tables import escape_markdown, format_markdown
from bsg_models.evaluation.bootstrap import Estimate

PACKAGE = "belief-scene-graphs"


@dataclass(frozen=True, slots=True)
class ResultsTable:
    """One table of a page.

    Attributes:
        title: heading; "" for none.
        header: names of the columns; the first column names the rows.
        rows: cells, as many a row as the header has.
        reading: text above the table that says how to read it.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    reading: str = ""


@dataclass(frozen=True, slots=True)
class Provenance:
    """How a page was made.

    Attributes:
        command: the command that makes the page again.
        date: day of the measurement, YYYY-MM-DD.
        versions: (package, version).
        class_space: class space of the dataset; "" without a dataset.
        dataset_sha256: hash of the dataset before it was split; "" without a dataset.
        buildings: number of buildings in the dataset; 0 without a dataset.
        with_geometry: those of which room sizes and places are known, which some models read.
        machine: where times were measured (`describe_machine`); "" if the page has no times.
    """

    command: str
    date: str
    versions: tuple[tuple[str, str], ...]
    class_space: str = ""
    dataset_sha256: str = ""
    buildings: int = 0
    with_geometry: int = 0
    machine: str = ""


@dataclass(frozen=True, slots=True)
class ResultsPage:
    """A page of results.

    Attributes:
        title: heading of the page.
        conclusions: paragraphs that say what was found.
        tables: the results.
        provenance: how the page was made.
    """

    title: str
    conclusions: tuple[str, ...]
    tables: tuple[ResultsTable, ...]
    provenance: Provenance


def format_page(page: ResultsPage) -> str:
    """Return a page as Markdown."""
    lines = [f"# {page.title}", ""]
    for conclusion in page.conclusions:
        lines += [conclusion, ""]
    for table in page.tables:
        lines += [f"## {table.title}", ""] if table.title else []
        lines += [table.reading, ""] if table.reading else []
        lines += [*format_markdown(table.rows, header=table.header), ""]
    made = page.provenance
    versions = ", ".join(f"{name} {number}" for name, number in made.versions)
    lines += ["## How it was made", "", "```sh", made.command, "```", ""]
    lines += [f"- Date: {made.date}", f"- Versions: {versions}"]
    if made.dataset_sha256:
        geometry = f" ({made.with_geometry} with geometry)" if made.with_geometry else ""
        lines.append(
            f"- Dataset: {made.buildings} buildings{geometry}, class space "
            f"{escape_markdown(made.class_space)}, `{made.dataset_sha256[:16]}` (start of the "
            "sha256 of `dataset.json` before the split)"
        )
    if made.machine:
        lines.append(f"- Machine: {made.machine}")
    lines.append("")
    return "\n".join(lines)


def write_page(page: ResultsPage, path: Path) -> None:
    """Write a page.

    Raises:
        DatasetError: if it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, format_page(page).encode())
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written ({error.strerror})") from error


def describe(data: Dataset, argv: Sequence[str], *, date: str) -> Provenance:
    """Return how the command `argv` made a page from a dataset."""
    return replace(
        describe_run(argv, date=date),
        class_space=data.manifest.class_space.name,
        dataset_sha256=hash_unsplit(data),
        buildings=data.manifest.totals.scenes,
        with_geometry=data.manifest.totals.placed,
    )


def describe_run(argv: Sequence[str], *, date: str) -> Provenance:
    """Return how the command `argv` made a page without a dataset."""
    versions = (
        (PACKAGE, version(PACKAGE)),
        ("torch", str(torch.__version__)),
        ("numpy", np.__version__),
    )
    return Provenance(format_command(argv), date, versions)


def describe_machine() -> str:
    """Return cores, system and Python of this machine, without its name."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    python = f"{platform.python_implementation()} {platform.python_version()}"
    return f"{cores} cores of {platform.machine()}, {platform.system()}, {python}"


def format_command(argv: Sequence[str]) -> str:
    """Return a command as a reader would type it, without the folders of this machine.

    A script keeps its path from `scripts/` on. A path that begins with `/`, `~` or `..` keeps its
    last name only.

    >>> format_command(["/srv/bsg/scripts/measure/masks.py", "--leaderboard", "/srv/board"])
    'python scripts/measure/masks.py --leaderboard board'
    """
    script = PurePath(argv[0]).parts
    place = script.index("scripts") if "scripts" in script else len(script) - 1
    words = ["python", "/".join(script[place:])]
    for word in argv[1:]:
        option, equals, value = word.partition("=")
        if not (equals and option.startswith("--")):
            option, equals, value = "", "", word
        path = PurePath(value)
        if path.is_absolute() or value.startswith((os.pardir, "~")):
            value = path.name
        word = option + equals + value
        words.append(f"'{word}'" if any(c in word for c in ' *;&|<>()$"') else word)
    return " ".join(words)


def format_estimate(estimate: Estimate, *, digits: int = 4, signed: bool = False) -> str:
    """Return a value with its interval; – if it is not defined.

    >>> format_estimate(Estimate(-0.00123, -0.002, -0.0004, nodes=9), digits=4, signed=True)
    '-0.0012 (-0.0020 to -0.0004)'
    """
    if np.isnan(estimate.value):
        return "–"
    sign = "+" if signed else ""
    value, low, high = (
        f"{number:{sign}.{digits}f}" for number in (estimate.value, estimate.low, estimate.high)
    )
    return value if np.isnan(estimate.low) else f"{value} ({low} to {high})"


def is_told_apart(estimate: Estimate) -> bool:
    """Say whether the interval of a difference excludes 0."""
    return bool(estimate.low > 0 or estimate.high < 0)
