"""The catalogue of sources: one row per source, and the entry points of `bsg_data.sources`."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError

from bsg_data.errors import SourceError
from bsg_data.files import AnyPath
from bsg_data.registry import Registry
from bsg_data.sources.source import Source, SourceRow
from bsg_data.terms import Terms
from bsg_data.words.nearest import ask_if_meant

_KINDS: tuple[type, ...] = (bool, int, float, Path)  # of options, besides text
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
        "cobie": "bsg_data.sources.cobie:ROW",
        "s3dis": "bsg_data.sources.s3dis:ROW",
        "spark-dsg": "bsg_data.sources.spark_dsg:ROW",
        "synthetic": "bsg_data.sources.hm3d:SYNTHETIC_ROW",
    },
)


def open_source(name: str, path: AnyPath, **options: object) -> Source:
    """Open a path as a source of the catalogue; this reads no file yet.

    Args:
        name: name of a row or of an installed entry point.
        path: file or folder of the source.
        options: options of the source, e.g. `meshes=False` for `hm3d`.

    Returns:
        The source, ready for `find` and `read`.

    Raises:
        RecipeError: if the name is unknown; the error has the nearest name.
        SourceError: if the source does not have an option, or the row does not open a source of
            this name.
    """
    path = Path(path)
    row = SOURCES[name]
    known = _list_options(row)
    for unknown in (option for option in options if option not in known):
        hint = ask_if_meant(unknown, known) or f"its options are {', '.join(known) or 'none'}"
        message = f"source {name!r} has no option {unknown!r}; {hint}"
        raise SourceError(message, code="option-unknown", where=name)
    source = row.open(path, **options)
    if not isinstance(source, Source) or source.kind not in SOURCES:
        raise SourceError(
            f"source {name!r}: its row opens a {type(source).__name__}; expected an object with "
            f"path, options, find and read, whose kind is {name!r}, the row with its terms",
            code="source-foreign",
            where=name,
        )
    return source


def parse_options(name: str, words: Mapping[str, str]) -> dict[str, object]:
    """Parse the options of a source from the words of a command line.

    The type of each option is the annotation of the keyword of the row's `open`: a bool (yes, no,
    true, false), an int, a float or a path; any other stays text.

    Args:
        name: name of a row or of an installed entry point.
        words: option → word.

    Returns:
        Option → value.
    """
    kinds, options = _list_options(SOURCES[name]), dict[str, object]()
    for option, word in words.items():
        try:  # `open_source` refuses one that the source does not have
            options[option] = TypeAdapter(kinds.get(option, str)).validate_python(word)
        except ValidationError as error:
            message = f"option {option}: {error.errors()[0]['msg']}; found {word!r}"
            raise SourceError(message, code="option-malformed", where=option) from error
    return options


def _list_options(row: SourceRow) -> dict[str, Any]:
    """Return name → type of the keywords of a row's `open`, without the path."""
    try:
        signature = inspect.signature(row.open, eval_str=True)
    except NameError:  # the annotation exists only for type checkers
        signature = inspect.signature(row.open)
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    _, *options = signature.parameters.values()
    kinds = {option.name: option.annotation for option in options if option.kind in named}
    return {
        name: next((known for known in _KINDS if known in (get_args(kind) or (kind,))), str)
        for name, kind in kinds.items()
    }


def find_terms(kind: str) -> Terms | None:
    """Return the terms of a kind of source; None if its row has none or the name is unknown."""
    return SOURCES[kind].terms if kind in SOURCES else None
