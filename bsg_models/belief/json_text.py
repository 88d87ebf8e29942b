"""Edit the text of a JSON document in place; everything else stays as it was, byte for byte.

Parsing a document and writing it again would lose the order of its keys, the notation of its
numbers and its line breaks. So the text itself is edited: parts are located, and text is inserted
or cut between them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

_SPACE = re.compile(r"[ \t\n\r]*")
_DECODER = json.JSONDecoder()


@dataclass(frozen=True, slots=True)
class Part:
    """A member of an object, or an item of a list, in the text of a document.

    Attributes:
        key: of a member; None for an item.
        begin: start of the part: of its key, if it has one.
        start: start of its value.
        end: end of its value.
        value: as `json.loads` returns it.
    """

    key: str | None
    begin: int
    start: int
    end: int
    value: Any


@dataclass(frozen=True, slots=True)
class Edit:
    """Replacement text for the range from `start` to `end`."""

    start: int
    end: int
    text: str


def find_start(text: str) -> int:
    """Return the start of a document's value, after its byte order mark and white space."""
    return _skip_space(text, 1 if text.startswith("\ufeff") else 0)


def list_parts(text: str, start: int) -> tuple[Part, ...]:
    """Return the parts of the object or list that begins at `start`.

    Raises:
        ValueError: if neither begins there.
    """
    opening = text[start : start + 1]
    if opening not in ("{", "["):
        raise ValueError(f"expected an object or a list at character {start}")
    parts: list[Part] = []
    at = _skip_space(text, start + 1)
    while text[at] not in "]}":
        begin, key = at, None
        if opening == "{":
            key, at = _DECODER.raw_decode(text, at)
            at = _skip_space(text, _skip_space(text, at) + 1)  # the colon, and space on both sides
        value, end = _DECODER.raw_decode(text, at)
        parts.append(Part(key, begin, at, end, value))
        at = _skip_space(text, end)
        if text[at] == ",":
            at = _skip_space(text, at + 1)
    return tuple(parts)


def find_member(parts: Sequence[Part], key: str) -> Part | None:
    """Return a member of an object by its key; of equal keys the last, as JSON readers do."""
    found = [part for part in parts if part.key == key]
    return found[-1] if found else None


def append_parts(text: str, start: int, parts: Sequence[Part], added: Sequence[str]) -> Edit:
    """Return the edit that appends parts to an object or list, spaced like its last part.

    Args:
        text: of the document.
        start: start of the object or list.
        parts: of the object or list.
        added: texts of the new parts.
    """
    if not parts:
        return Edit(start + 1, start + 1, ",".join(added))
    last = parts[-1]
    after = parts[-2].end if len(parts) > 1 else start + 1
    space = text[after : last.begin].rpartition(",")[2]
    return Edit(last.end, last.end, "".join(f",{space}{part}" for part in added))


def cut_parts(parts: Sequence[Part], chosen: Collection[int]) -> list[Edit]:
    """Return the edits that cut parts out of an object or list.

    Each part is cut with the text between it and the part before it. So cutting what `append_parts`
    added restores the text.

    Args:
        parts: of the object or list.
        chosen: indices of the parts to cut, from 0.
    """
    left = [number for number in range(len(parts)) if number not in chosen]
    first = left[0] if left else 0
    edits = []
    if first:
        edits.append(Edit(parts[0].begin, parts[first].begin, ""))
    elif not left and parts:
        edits.append(Edit(parts[0].begin, parts[-1].end, ""))
    return edits + [
        Edit(parts[number - 1].end, parts[number].end, "")
        for number in sorted(chosen)
        if left and number > first
    ]


def apply_edits(text: str, edits: Iterable[Edit]) -> str:
    """Return the text after non-overlapping edits; edits at one place apply in their order."""
    pieces, at = [], 0
    for edit in sorted(edits, key=lambda edit: (edit.start, edit.end)):
        pieces += [text[at : edit.start], edit.text]
        at = edit.end
    return "".join((*pieces, text[at:]))


def _skip_space(text: str, at: int) -> int:
    found = _SPACE.match(text, at)
    return at if found is None else found.end()
