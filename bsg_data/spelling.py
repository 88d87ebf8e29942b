"""Find the known names that are most similar to an unknown one."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence

SHOWN = 80  # characters of a wrong name that are compared, and shown in errors
_LEAST_LIKENESS = (
    0.75  # difflib's ratio: keeps shoos for shoes and vaze for vase; not mobile for bicycle
)
_FEWEST_LETTERS = 4  # letters by which a word of a name is known


def nearest_names(name: str, known: Iterable[str]) -> tuple[str, ...]:
    """Return the three known names that have most letters of a name; case is ignored.

    >>> nearest_names("Kitchn", ["kitchen", "hall", "KITCHENETTE"])
    ('kitchen', 'KITCHENETTE')
    """
    listed = {one[:SHOWN].casefold(): one for one in known}
    near = difflib.get_close_matches(name[:SHOWN].casefold(), listed, n=3)
    return tuple(listed[one] for one in near)


def meant_names(name: str, known: Iterable[str], *, most: int = 3) -> tuple[str, ...]:
    """Return the known names that a misspelt, longer or cut off name may stand for, the best first.

    >>> meant_names("microwav", ["microwave", "wave"]), meant_names("bicycle", ["boiler"])
    (('microwave',), ())
    >>> meant_names("living room", ["living", "bath"]), meant_names("fridg", ["mini fridge"])
    (('living',), ('mini fridge',))
    """
    listed = {words: one for one in known if (words := _split_words(one))}
    said = _split_words(name)
    joined = {words.replace(" ", ""): words for words in listed}
    near = difflib.get_close_matches(said.replace(" ", ""), joined, n=most, cutoff=_LEAST_LIKENESS)
    longer = [words for words in listed if f" {words} " in f" {said} "]
    cut_off = [
        words for words in listed if len(said) >= _FEWEST_LETTERS and f" {said}" in f" {words}"
    ]
    found = [joined[one] for one in near]
    found += sorted(longer, key=len, reverse=True) + sorted(cut_off, key=len)
    return tuple(listed[words] for words in dict.fromkeys(found))[:most]


def _split_words(name: str) -> str:
    return " ".join(re.findall(r"[^\W_]+", name[:SHOWN].casefold()))


def ask_if_meant(name: str, known: Iterable[str], *, most: int = 1) -> str:
    """Return the question whether a similar name was meant; empty if none is similar."""
    near = meant_names(name, known, most=most)
    return f"did you mean {', '.join(near)}?" if near else ""


def list_some(names: Sequence[str], most: int) -> str:
    """Return the first names, cut, and how many more there are.

    >>> list_some(["a", "", "c"], 2)
    'a, (no name) and 1 more'
    """
    shown = ", ".join(name[:SHOWN] or "(no name)" for name in names[:most])
    return shown if len(names) <= most else f"{shown} and {len(names) - most:,} more"


def show_value(value: object) -> str:
    """Return what a caller gave instead of what was expected, in at most `SHOWN` characters."""
    try:
        return repr(value)[:SHOWN]
    except Exception:  # a class of the caller's, or digits that Python refuses to print
        return f"a value of type {type(value).__name__}"
