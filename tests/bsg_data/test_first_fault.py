"""What strangers fill is validated to the first fault: not to millions, which take gigabytes."""

from __future__ import annotations

from typing import Annotated, Any, get_args, get_origin

import pytest
from pydantic import BaseModel, FailFast, Field, ValidationError, WrapValidator

from bsg_data.first_fault import ForeignRecord, Keyed, Listed
from bsg_data.recipes import Record, SaidRecord, name_fault
from bsg_data.sources import (
    behavior,
    dsg_file,
    layout_files,
    procthor,
    spark_dsg,
)
from bsg_robot.graph import document

MANY = 100_000
STRANGERS = (behavior, dsg_file, layout_files, procthor, spark_dsg, document)


class Shelf(SaidRecord):
    """A record with all that may have many entries."""

    name: str = ""
    books: Listed[int] = ()
    pages: Annotated[Keyed[str, int], Field(max_length=MANY)] = Field(default_factory=dict)
    boxes: Keyed[str, Keyed[str, int]] = Field(default_factory=dict)
    label: Annotated[str, Field(alias="class")] = ""


def faults_of(said: dict[str, Any]) -> ValidationError:
    with pytest.raises(ValidationError) as caught:
        Shelf.model_validate(said)
    return caught.value


@pytest.mark.parametrize(
    ("said", "where"),
    [
        ({"books": ["a"] * MANY}, "books.0"),
        ({"pages": {f"page {n}": "a" for n in range(MANY)}}, "pages.page 0"),
        (
            {"boxes": {f"b{n}": {f"c{m}": "a" for m in range(300)} for n in range(300)}},
            "boxes.b0.c0",
        ),
        ({f"key {n}": 1 for n in range(MANY)} | {"class": "x"}, "key 0"),
    ],
)
def test_few_of_many_faults_are_looked_for(said: dict[str, Any], where: str) -> None:
    error = faults_of(said)
    assert error.error_count() <= 400
    assert name_fault(error).startswith(f"{where}: ")


def test_a_late_fault_is_found_and_named() -> None:
    pages = {f"page {n}": n for n in range(MANY)} | {"last": "a"}
    assert name_fault(faults_of({"pages": pages})).startswith("pages.last: ")


def test_a_long_mapping_stays_as_it_is_and_in_its_order() -> None:
    pages = {f"page {n}": n for n in range(1000, 0, -1)}
    assert [*Shelf(pages=pages).pages.items()] == [*pages.items()]
    assert name_fault(faults_of({"pages": {str(n): n for n in range(MANY + 1)}})).startswith(
        "pages: expected at most 100,000 entries"
    )


def parts_of(hint: Any) -> list[Any]:
    """Return what a type is made of: itself, what it annotates, and so on."""
    return [hint, *(part for one in get_args(hint) for part in parts_of(one))]


def bare_lists(model: type[BaseModel]) -> list[str]:
    """Return the fields of a record whose lists or mappings gather faults without an end."""
    found = []
    for name, field in model.model_fields.items():
        hints = parts_of(Annotated[(field.annotation, *field.metadata, name)])
        guarded = {
            id(get_args(one)[0])
            for one in hints
            if get_origin(one) is Annotated
            and any(isinstance(mark, FailFast | WrapValidator) for mark in get_args(one)[1:])
        }
        found += [
            f"{model.__name__}.{name}"
            for one in hints
            if id(one) not in guarded
            and (
                get_origin(one) is list
                or (get_origin(one) is dict and get_args(one)[1] is not Any)
                or (get_origin(one) is tuple and get_args(one)[-1] is ...)
            )
        ]
    return found


def test_no_record_of_strangers_gathers_faults_without_an_end() -> None:
    records = [
        one
        for module in STRANGERS
        for one in vars(module).values()
        if isinstance(one, type) and issubclass(one, Record | ForeignRecord)
    ]
    assert len(records) > 20
    assert [name for one in records for name in bare_lists(one)] == []
