"""The catalogue of sources: one row a source, then the entry points of `bsg_data.sources`."""

from __future__ import annotations

import inspect
from pathlib import Path

from bsg_data.errors import SourceError
from bsg_data.registry import Registry
from bsg_data.sources.source import Source, SourceRow, Terms

SOURCES = Registry(
    "source",
    SourceRow,
    group="bsg_data.sources",
    rows={
        "hm3d": "bsg_data.sources.hm3d:ROW",
        "hm3d-stats": "bsg_data.sources.hm3d_stats:ROW",
        "mp3d": "bsg_data.sources.mp3d:ROW",
        "spark-dsg": "bsg_data.sources.spark_dsg:ROW",
        "synthetic": "bsg_data.sources.synthetic:ROW",
    },
)


def open_source(name: str, path: Path, **options: object) -> Source:
    """Open a path as a source of the catalogue; nothing of it is read yet.

    Args:
        name: of a row, or of an installed entry point.
        path: what the source reads.
        options: the source's own, e.g. `meshes=False` for `hm3d`.

    Raises:
        RecipeError: for a name that nobody knows, with the nearest.
        SourceError: for an option that the source does not take, or for a row that opens something
            else than a source of its name.
    """
    row = SOURCES[name]
    try:
        inspect.signature(row.open).bind(path, **options)
    except TypeError as error:
        names = list(inspect.signature(row.open).parameters)[1:]
        raise SourceError(
            f"source {name!r}: {error}; its options are {', '.join(names) or 'none'}"
        ) from error
    source = row.open(path, **options)
    if not isinstance(source, Source):
        raise SourceError(
            f"source {name!r}: its row opens a {type(source).__name__}, which is no source; "
            "expected kind, path, options, find and read"
        )
    if source.kind not in SOURCES:
        raise SourceError(
            f"source {name!r}: what it opens is of kind {source.kind!r}, which is no row; "
            f"expected {name!r}, under which its terms are found"
        )
    return source


def find_terms(kind: str) -> Terms | None:
    """Return the terms of a kind of source; None if no row and no entry point has its name.

    Raises:
        RecipeError: if there is an entry point of that name and it cannot be imported.
    """
    return SOURCES[kind].terms if kind in SOURCES else None
