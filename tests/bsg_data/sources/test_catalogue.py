"""The catalogue of sources: its rows, their options and their terms."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from conftest import write_twelve
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.sources.catalogue import SOURCES, open_source, parse_options
from bsg_data.sources.source import SourceRow
from bsg_data.terms import Terms

NONE = SourceRow("no source", lambda path: path, None)


def test_real_buildings_are_no_synthetic_ones(tmp_path: Path) -> None:
    with refuses(SourceError, "source-mixed"):
        open_source("synthetic", write_twelve(tmp_path / "real"))


def test_a_row_that_opens_no_source_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    point = EntryPoint("none", f"{__name__}:NONE", SOURCES.group)
    monkeypatch.setitem(SOURCES._rows, "none", point)
    with refuses(SourceError, "source-foreign", "none"):
        open_source("none", tmp_path)


@pytest.mark.parametrize(
    ("source", "words", "expected"),
    [
        ("behavior", {"as_listed": "Yes"}, {"as_listed": True}),
        ("hm3d", {"meshes": "0", "snap_colours": "8"}, {"meshes": False, "snap_colours": 8}),
        ("table", {"scene": "1"}, {"scene": "1"}),
        ("procthor", {}, {}),
        ("behavior", {"as_listed": "2"}, "option-malformed"),
        ("hm3d", {"snap_colours": "eight"}, "option-malformed"),
        ("hm3d", {"mesh": "no"}, "option-unknown"),
        ("behavior", {"aslisted": "no"}, "option-unknown"),
        ("procthor", {"x": "no"}, "option-unknown"),
    ],
)
def test_words_become_what_a_source_takes(
    tmp_path: Path, source: str, words: dict[str, str], expected: Any
) -> None:
    if isinstance(expected, dict):
        assert parse_options(source, words) == expected
        open_source(source, tmp_path, **expected)
    else:
        with refuses(SourceError, expected):
            open_source(source, tmp_path, **parse_options(source, words))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("licence", "MIT\nlicense_name: x"),
        ("licence_url", "creativecommons.org"),
        ("homepage", "javascript:alert(1)"),
        ("citation", ""),
        ("sentence", "One.\n---\nTwo."),
    ],
)
def test_terms_that_would_spoil_a_card_are_refused(field: str, value: str) -> None:
    terms = {
        "licence": "MIT",
        "licence_url": "https://opensource.org/license/mit",
        "homepage": "https://example.org",
        "citation": "A. Doll, 2020",
        "sentence": "The houses are under the MIT licence.",
    }
    assert Terms(**terms).licence == "MIT"
    with refuses(SourceError, "terms-malformed", field):
        Terms(**{**terms, field: value})
