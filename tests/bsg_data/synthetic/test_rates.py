"""The rates of synthetic buildings: what is shipped, and what is refused."""

from __future__ import annotations

import json
import re
from importlib import resources
from typing import Any

import pytest

from bsg_data.synthetic.rates import load_rates, parse_rates

RATES_TEXT = resources.files("bsg_data.synthetic").joinpath("rates.json").read_text("utf-8")
RATES = load_rates()


@pytest.mark.parametrize("field", [k for k in json.loads(RATES_TEXT) if k not in ("about",)])
def test_a_missing_field_is_named(field: str) -> None:
    data = json.loads(RATES_TEXT)
    del data[field]
    if field == "fitted_on":  # only told, not used
        assert parse_rates(json.dumps(data)) == RATES
        return
    with pytest.raises(ValueError, match=rf"rates\.json: {field}: Field required"):
        parse_rates(json.dumps(data))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("version", 2),
        ("order", [0.5]),
        ("style", None),
        ("style", "many"),
        ("growth", 1.5),
        ("growth", [0.5]),
        ("gap", -0.1),
        ("stray", float("nan")),
        ("richness", [0, 0.1]),
        ("novelty", [1, 2, 3]),
        ("sizes", []),
        ("rates", [[1.0]]),
        ("rooms", [1, 1]),
        ("rooms", [0, 0]),
        ("rooms", []),
        ("rooms", [0] * 200 + [1]),
        ("bins", []),
        ("bins", [[99, [[1.0]]]]),
        ("bins", 3),
        ("bins", [5]),
        ("categories", ["wall", "wall"]),
        ("spellings", []),
        ("spellings", [[['a "quoted" name', 1.0]]]),
        ("spellings", [[["wall", 0.0]]]),
        ("spellings", [["wall"]]),
    ],
)
def test_a_malformed_field_is_refused(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=r"^rates\.json: "):
        parse_rates(json.dumps(json.loads(RATES_TEXT) | {field: value}))


@pytest.mark.parametrize("text", ["", "{", "[]", "3"])
def test_text_that_is_no_object_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"^rates\.json: "):
        parse_rates(text)


def test_the_rates_are_small_and_aggregate() -> None:
    data = json.loads(RATES_TEXT)
    assert len(RATES_TEXT.encode()) < 200_000
    assert data["fitted_on"]["least_scenes_of_a_name"] >= 5
    assert not re.search(r"[0-9]{5}-[A-Za-z0-9]{11}", RATES_TEXT), "no scene ids"
