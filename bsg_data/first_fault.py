"""Records of strangers whose validation ends at the first fault: millions would take gigabytes.

Pydantic gathers all faults of a document, though an error of ours tells one. Every list and every
mapping that a stranger may fill is a `Listed` or a `Keyed`. A `ForeignRecord` is of another
program, whose other keys are ignored.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import islice
from typing import Annotated, Any, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)

_TOGETHER = 20  # entries of a mapping that are validated together, and whose faults are gathered
_Item = TypeVar("_Item")
_Key = TypeVar("_Key")
_Value = TypeVar("_Value")


def _validate_in_parts(said: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    """Validate a few entries of a mapping at a time; pydantic can end only lists early."""
    if not isinstance(said, dict) or len(said) <= _TOGETHER:
        return handler(said)
    entries, found = iter(said.items()), {}
    while part := dict(islice(entries, _TOGETHER)):
        found.update(handler(part))
    return found


class _FirstFault(FailFast):
    """What pydantic has for lists, with a hash: without one, no union may hold it."""

    __hash__ = object.__hash__


Listed = Annotated[tuple[_Item, ...], _FirstFault()]
Keyed = Annotated[dict[_Key, _Value], WrapValidator(_validate_in_parts)]


def keep_one_unknown(said: Any, known: Collection[str]) -> Any:
    """Return a mapping with the first of its unknown keys, which is a fault, and without others."""
    if not isinstance(said, dict) or len(said) <= len(known):
        return said
    kept = {key: said[key] for key in known if key in said}
    return kept | {key: said[key] for key in islice((k for k in said if k not in kept), 1)}


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
