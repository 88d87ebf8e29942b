"""Records: ours, those that strangers fill, and those of other programs; and how faults are told.

Pydantic gathers all faults of a document, though an error of ours tells one: of millions, that
would take gigabytes. So every list and every mapping that a stranger may fill is a `Listed` or a
`Keyed`, whose validation ends at the first fault.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import islice
from numbers import Real
from typing import Annotated, Any, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from bsg_data.errors import RecipeError, ask_to_upgrade
from bsg_data.tables import make_line
from bsg_data.words.shown import SHOWN, show_value

_TOGETHER = 20  # entries of a mapping that are validated together, and whose faults are gathered
_Item = TypeVar("_Item")
_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


def _validate_in_parts(document: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """Validate a few entries of a mapping at a time; pydantic can end only lists early."""
    if not isinstance(document, dict) or len(document) <= _TOGETHER:
        return handler(document)
    entries, found = iter(document.items()), {}
    while part := dict(islice(entries, _TOGETHER)):
        found.update(handler(part))
    return found


class _FirstFault(FailFast):
    """What pydantic has for lists, with a hash: without one, no union may hold it."""

    __hash__ = object.__hash__


Listed = Annotated[tuple[_Item, ...], _FirstFault()]
Keyed = Annotated[dict[_Key, _Value], WrapValidator(_validate_in_parts)]


def keep_one_unknown(document: Any, known: Collection[str]) -> Any:
    """Return a mapping with the first of its unknown keys, which is a fault, and without others."""
    if not isinstance(document, dict) or len(document) <= len(known):
        return document
    listed = {key: document[key] for key in known if key in document}
    return listed | {
        key: document[key] for key in islice((k for k in document if k not in listed), 1)
    }


class Record(BaseModel):
    """A frozen record that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SaidRecord(Record):
    """A record that a stranger fills: of many unknown keys, one is told."""

    @model_validator(mode="before")
    @classmethod
    def _keep_one_unknown(cls, document: Any) -> Any:
        known = {field.alias or name for name, field in cls.model_fields.items()}
        return keep_one_unknown(document, known)


MAX_METRES = 1_000_000.0  # from the origin: a map may be in the metres of a country's grid
Metres = Annotated[float, Field(ge=-MAX_METRES, le=MAX_METRES)]


class ForeignRecord(BaseModel):
    """A frozen record that another program wrote, with keys of its own."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Position(ForeignRecord):
    """A point, in metres."""

    x: Metres
    y: Metres
    z: Metres


# kinds of faults: our own message, a text that is no JSON, an unknown key
_SELF_EXPLAINING = ("value_error", "json_invalid", "extra_forbidden")


def name_fault(error: ValidationError) -> str:
    """Return key and kind of the first fault of a record: `rooms.0.id: Field required`.

    A word or a number that is wrong is shown, unless the fault is not in it or says it already.
    """
    first = error.errors(include_url=False)[0]
    where = ".".join(make_line(str(key)[:SHOWN]) for key in first["loc"]) or "the whole file"
    value = first["input"]
    is_shown = isinstance(value, str | int | float) and first["type"] not in _SELF_EXPLAINING
    shown = f", found {show_value(value)}" if is_shown else ""
    fault = first["msg"].removeprefix("Value error, ").removeprefix(f"{where}: ")
    fault = fault.replace("valid tuple", "valid list")
    if first["type"] == "too_long":  # pydantic's words say that it was validated
        fault = f"expected at most {first['ctx']['max_length']:,} entries, found more"
    if first["type"] == "literal_error" and first["loc"][-1:] == ("version",):
        shown += f"; {ask_to_upgrade(value, 1, otherwise='another program wrote it')}"
    return f"{where}: {fault}{shown}"


def read_number(name: str, value: object, *, most: float, wanted: str = "") -> float:
    """Return a number from 0 to `most`, of Python or of NumPy, as Python's."""
    try:
        is_number = isinstance(value, Real) and not isinstance(value, bool)
        number = float(value) if is_number else math.nan  # type: ignore[arg-type]
    except OverflowError:  # an integer beyond all floats
        number = math.nan
    if 0 <= number <= most:
        return number
    span = "0 or more" if most == math.inf else f"0 to {most:g}"
    raise RecipeError(
        f"{name}: expected {wanted or span}, found {show_value(value)}", code="number-impossible"
    )
