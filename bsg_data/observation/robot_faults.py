"""Explain a fault in a robot's JSON, naming the room or the object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from bsg_data.spelling import SHOWN, ask_if_meant, show_value

_WORDS = {None: "null", True: "true", False: "false"}
_ENTRIES = {"rooms": "room", "objects": "object", "adjacency": "pair of adjacency"}


def explain_fault(error: ValidationError, said: Any, *, keys: Mapping[str, Sequence[str]]) -> str:
    """Return place and kind of a fault: `room 'kitchen': hidden_share: Input should be …`.

    A key that is unknown comes first, for what is missing may stand under it.

    Args:
        error: of its validation.
        said: the document.
        keys: that it may have: of the whole under an empty name, and of the entries of its lists.
    """
    faults = error.errors(include_url=False, include_input=False)
    unknown = (fault for fault in faults if fault["type"] == "extra_forbidden")
    fault = next(unknown, faults[0])
    entry, path = _name_entry(fault["loc"], said)
    if fault["type"] != "extra_forbidden":
        where = ".".join(map(str, path)) or ("" if entry else "the whole file")
        return ": ".join(filter(None, (entry, where, _say(fault))))
    wrong, known = str(path[-1]), keys[str(fault["loc"][0]) if entry else ""]
    hint = ask_if_meant(wrong, known) or f"known are {', '.join(known)}"
    return ": ".join(filter(None, (entry, f"{wrong[:SHOWN]!r} is no key; {hint}")))


def show_json(value: object) -> str:
    """Return what a document has instead of what was expected, in the words of JSON.

    >>> show_json(None), show_json(True), show_json(1), show_json("half")
    ('null', 'true', '1', "'half'")
    """
    return _WORDS[value] if value is None or isinstance(value, bool) else show_value(value)


def _say(fault: Mapping[str, Any]) -> str:
    """Return what is wrong, in the words of pydantic but where they are of Python's types."""
    if fault["type"] == "too_long":
        most, found = fault["ctx"]["max_length"], fault["ctx"]["actual_length"]
        return f"expected at most {most:,}, found {'more' if found is None else f'{found:,}'}"
    if fault["type"] == "model_type":
        return "expected a JSON object (docs/belief.md)"
    if fault["type"] == "tuple_type":
        return "expected a JSON list"
    return str(fault["msg"]).removeprefix("Value error, ")


def _name_entry(loc: tuple[int | str, ...], said: Any) -> tuple[str, tuple[int | str, ...]]:
    """Return the entry of a list that a place is in, by its id or its number, and the rest of it.

    The first is empty for a place outside the lists.
    """
    if len(loc) < 2 or loc[0] not in _ENTRIES or not isinstance(loc[1], int):
        return "", loc
    kind, entries = _ENTRIES[str(loc[0])], said[loc[0]]
    entry = entries[loc[1]] if isinstance(entries, Sequence) else None  # JSON has sequences only
    name = entry.get("id") if isinstance(entry, Mapping) else None
    if isinstance(name, str) and name:
        return f"{kind} {name[:SHOWN]!r}", loc[2:]
    return f"{kind} number {loc[1] + 1}", loc[2:]
