"""A fault is named; what strangers fill is validated to the first, not to millions of them."""

from __future__ import annotations

import re
from typing import Annotated, Any

import pytest
from pydantic import Field, ValidationError, field_validator

from bsg_data.records import Keyed, Listed, Record, SaidRecord, name_fault

MANY = 100_000


class Pet(Record):
    name: str = ""
    age: int = 0

    @field_validator("name")
    @classmethod
    def _short(cls, name: str) -> str:
        if len(name) > 3:
            raise ValueError(f"expected at most 3 letters, found {len(name)}")
        return name


class Shelf(SaidRecord):
    """A record with all that may have many entries."""

    books: Listed[int] = ()
    pages: Annotated[Keyed[str, int], Field(max_length=MANY)] = Field(default_factory=dict)
    boxes: Keyed[str, Keyed[str, int]] = Field(default_factory=dict)
    label: Annotated[str, Field(alias="class")] = ""


@pytest.mark.parametrize(
    ("values", "fault"),
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
def test_a_fault_is_named_with_the_value_that_is_wrong(values: dict[str, Any], fault: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Pet.model_validate(values)
    assert re.match(fault, name_fault(caught.value)), name_fault(caught.value)


def test_a_text_that_is_no_json_is_not_shown() -> None:
    with pytest.raises(ValidationError) as caught:
        Pet.model_validate_json('{"age": 1')
    assert re.match("the whole file: Invalid JSON: EOF[^']*$", name_fault(caught.value))


@pytest.mark.parametrize(
    ("values", "where"),
    [
        ({"books": ["a"] * MANY}, "books.0: "),
        ({"pages": {f"page {n}": "a" for n in range(MANY)}}, "pages.page 0: "),
        ({"pages": {f"{n}": n for n in range(MANY - 1)} | {"last": "a"}}, "pages.last: "),
        ({"pages": {f"{n}": n for n in range(MANY + 1)}}, "pages: expected at most 100,000 ent"),
        (
            {"boxes": {f"b{n}": {f"c{m}": "a" for m in range(300)} for n in range(300)}},
            "boxes.b0.c0: ",
        ),
        ({f"key {n}": 1 for n in range(MANY)} | {"class": "x"}, "key 0: "),
    ],
)
def test_few_of_many_faults_are_looked_for(values: dict[str, Any], where: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Shelf.model_validate(values)
    assert caught.value.error_count() <= 400
    assert name_fault(caught.value).startswith(where)


def test_a_long_mapping_stays_as_it_is_and_in_its_order() -> None:
    pages = {f"page {n}": n for n in range(1000, 0, -1)}
    assert [*Shelf(pages=pages).pages.items()] == [*pages.items()]
