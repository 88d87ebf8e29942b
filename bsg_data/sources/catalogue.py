"""The catalogue of sources: one row a source, then the entry points of `bsg_data.sources`."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import get_args

from bsg_data.errors import SourceError
from bsg_data.registry import Registry
from bsg_data.sources.source import Source, SourceRow, Terms
from bsg_data.spelling import ask_if_meant

SOURCES = Registry(
    "source",
    SourceRow,
    group="bsg_data.sources",
    rows={
        "hm3d": "bsg_data.sources.hm3d:ROW",
        "hm3d-stats": "bsg_data.sources.hm3d_stats:ROW",
        "behavior": "bsg_data.sources.behavior:ROW",
        "procthor": "bsg_data.sources.procthor:ROW",
        "table": "bsg_data.sources.table:ROW",
        "mp3d": "bsg_data.sources.mp3d:ROW",
        "spark-dsg": "bsg_data.sources.spark_dsg:ROW",
        "synthetic": "bsg_data.sources.synthetic:ROW",
    },
)


_TRUTHS = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}
_PARSERS: Mapping[type, Callable[[str], object]] = {
    bool: lambda word: _TRUTHS[word.casefold()],
    int: int,
    float: float,
    Path: Path,
}


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


def parse_options(name: str, words: Mapping[str, str]) -> dict[str, object]:
    """Return the options of a source from words, as a command has them.

    A word becomes what the keyword of the row's `open` is annotated with: a bool from yes, no, true
    or false, an int, a float or a path; otherwise it stays text.

    Args:
        name: of a row, or of an installed entry point.
        words: the source's own options by name.

    Raises:
        RecipeError: for a source that nobody knows, with the nearest.
        SourceError: for an option that the source does not have, with those that it has, or for a
            word that its type does not take.
    """
    kinds = _list_options(SOURCES[name])
    for option in words:
        if option not in kinds:
            asked = ask_if_meant(option, kinds)
            hint = f"; {asked}" if asked else "."
            known = ", ".join(kinds) or "none"
            raise SourceError(
                f"source {name!r} has no option {option!r}{hint} Its options: {known}"
            )
    return {option: _parse_word(word, kinds[option], option) for option, word in words.items()}


def _list_options(row: SourceRow) -> dict[str, object]:
    """Return name → annotation of what a row's `open` takes beside the path."""
    try:
        signature = inspect.signature(row.open, eval_str=True)
    except NameError:  # of an annotation that is for type checkers alone
        signature = inspect.signature(row.open)
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    _, *options = signature.parameters.values()
    return {option.name: option.annotation for option in options if option.kind in named}


def _parse_word(word: str, kind: object, option: str) -> object:
    """Return a word as the first of the types that an annotation names and a word can be."""
    kinds = get_args(kind) or (kind,)
    for wanted, parse in _PARSERS.items():
        if wanted in kinds:
            try:
                return parse(word)
            except (ValueError, KeyError) as error:
                expected = "yes or no" if wanted is bool else f"a value of type {wanted.__name__}"
                raise SourceError(
                    f"option {option}: expected {expected}, found {word!r}"
                ) from error
    return word


def find_terms(kind: str) -> Terms | None:
    """Return the terms of a kind of source; None where its row has none, or nobody has its name.

    Raises:
        RecipeError: if there is an entry point of that name and it cannot be imported.
    """
    return SOURCES[kind].terms if kind in SOURCES else None
