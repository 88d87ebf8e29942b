"""Read and write belief graphs in several formats, chosen by the suffix of the file.

Packages add a format with an entry point of the group `bsg_robot.formats` that names a
`FormatRow`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.registry import Registry
from bsg_data.results import write_results
from bsg_models.belief.belief_graph import BeliefGraph


@dataclass(frozen=True, slots=True)
class FormatRow:
    """The writer and reader of one format of belief graphs.

    A format of one graph per file has `write`; a format of many has `write_all`; beliefs of a
    format with neither go into a file of another program. A failed write leaves no partial file. A
    format that cannot be read has no `read`.
    """

    name: str
    suffixes: tuple[str, ...]  # endings of its file names, e.g. `.json`
    write: Callable[[BeliefGraph, Path], None] | None = None
    read: Callable[[Path], BeliefGraph] | None = None
    write_all: Callable[[Iterable[BeliefGraph], Path], None] | None = None
    # of a format whose `write_all` fills an empty folder, which gets a seal: a file that is in it
    report: str = ""

    def require_writer(self, path: Path) -> None:
        """Refuse to write a new file of a format that only adds to files of another program."""
        if self.write is None and self.write_all is None:
            raise RecipeError(
                f"{path}: {self.name} adds beliefs to one graph of its program, and makes none: "
                "give that graph alone, or write json",
                code="format-not-new",
                where=path,
            )


FORMATS = Registry(
    "format",
    FormatRow,
    group="bsg_robot.formats",
    rows={
        "json": "bsg_robot.graph.document:JSON",
        "spark-dsg": "bsg_robot.graph.annotation:SPARK_DSG",
        "html": "bsg_robot.graph.document:HTML",
    },
)


def choose_format(path: Path) -> FormatRow:
    """Return the format of the longest suffix that a path ends with."""
    rows, broken = FORMATS.load_all()
    name = path.name.casefold()
    suffixes = [(suffix, row) for row in rows.values() for suffix in row.suffixes]
    fitting = [(s, row) for s, row in suffixes if name.endswith(s) and len(name) > len(s)]
    if not fitting:
        known = ", ".join(f"{suffix} ({row.name})" for suffix, row in suffixes)
        raise RecipeError(
            f"{path}: no format of belief graphs has this suffix; name the file with one of "
            f"{known}, or install its package (docs/belief.md)"
            f"{''.join(f'; {fault}' for fault in broken)}",
            code="format-unknown",
            where=path,
        )
    return max(fitting, key=lambda fit: len(fit[0]))[1]


def write_belief(belief: BeliefGraph, path: AnyPath) -> None:
    """Write a belief graph in the format of a path's suffix.

    Args:
        belief: to be written.
        path: of the file, e.g. `belief.json`.

    Raises:
        RecipeError: if no format has this suffix, or it is Spark-DSG's: see `annotate_hydra`.
        DatasetError: if it cannot be written.
    """
    write_beliefs([belief], Path(path), choose_format(Path(path)))


def write_beliefs(beliefs: Iterable[BeliefGraph], path: Path, row: FormatRow) -> None:
    """Write belief graphs in a format; several are refused if it holds one."""
    row.require_writer(path)
    if row.write_all is not None:
        with write_results(path, report=row.report) if row.report else nullcontext(path) as place:
            row.write_all(beliefs, place)
        return
    several = list(beliefs)
    if len(several) != 1 or row.write is None:
        many = (name for name, other in FORMATS.load_all()[0].items() if other.write_all)
        raise RecipeError(
            f"{path}: the format {row.name} holds one belief graph, and there are {len(several)}; "
            f"use one of {', '.join(many)}",
            code="graphs-several",
            where=path,
        )
    row.write(several[0], path)


def read_belief(path: AnyPath) -> BeliefGraph:
    """Read the belief graph of a file, in the format of its suffix.

    Args:
        path: of the file.

    Raises:
        RecipeError: if no format has this suffix, or the format cannot be read.
        BeliefFileError: if the file is none of this format.
    """
    path = Path(path)
    row = choose_format(path)
    if row.read is None:
        raise RecipeError(
            f"{path}: the format {row.name} is written only, and cannot be read; write json as "
            "well",
            code="format-written-only",
            where=path,
        )
    return row.read(path)
