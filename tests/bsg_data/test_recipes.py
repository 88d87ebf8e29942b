from __future__ import annotations

import re
from typing import Any

import pytest
from pydantic import ValidationError, field_validator

from bsg_data.recipes import Record, name_fault


class Pet(Record):
    name: str = ""
    age: int = 0

    @field_validator("name")
    @classmethod
    def _short(cls, name: str) -> str:
        if len(name) > 3:
            raise ValueError(f"expected at most 3 letters, found {len(name)}")
        return name


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"age": "half"}, "age: Input should be a valid integer.*, found 'half'$"),
        ({"age": 0.5}, "age: Input should be .*, found 0.5$"),
        ({"age": "9" * 999 + "x"}, "age: Input .*, found '9{79}$"),
        ({"age": [1]}, "age: Input should be a valid integer$"),
        ({"name": "Felix"}, "name: expected at most 3 letters, found 5$"),
        (
            {"x\x1b" + "y" * 999: 1},
            "x\N{REPLACEMENT CHARACTER}y{78}: Extra inputs",
        ),
    ],
)
def test_a_fault_is_named_with_the_value_that_is_wrong(values: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Pet.model_validate(values)
    assert re.match(said, name_fault(caught.value)), name_fault(caught.value)


def test_a_text_that_is_no_json_is_not_shown() -> None:
    with pytest.raises(ValidationError) as caught:
        Pet.model_validate_json('{"age": 1')
    assert re.match("the whole file: Invalid JSON: EOF[^']*$", name_fault(caught.value))
