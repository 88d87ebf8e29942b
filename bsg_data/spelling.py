"""Find the known names that are most similar to an unknown one."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

SHOWN = 80  # characters of a wrong name that are compared, and shown in errors
LIKE = 0.75  # difflib's ratio: keeps shoos for shoes and vaze for vase; not mobile for bicycle
BEGUN = 4  # letters by which a word of a name is known


def nearest_names(name: str, known: Iterable[str], *, most: int = 3) -> tuple[str, ...]:
    """Return the known names that are most like a name, the most like first; case is ignored.

    No more than `SHOWN` characters are compared, so that a name of any length is answered at once.

    >>> nearest_names("Kitchn", ["kitchen", "hall", "KITCHENETTE"])
    ('kitchen', 'KITCHENETTE')
    """
    listed = {one[:SHOWN].casefold(): one for one in known}
    near = difflib.get_close_matches(name[:SHOWN].casefold(), listed, n=most)
    return tuple(listed[one] for one in near)


def meant_names(name: str, known: Iterable[str], *, most: int = 3) -> tuple[str, ...]:
    """Return the known names that a misspelt, cut off or longer name may stand for, the best first.

    Unlike the nearest names, they are more than names that share letters. Punctuation is ignored.

    >>> meant_names("microwav", ["microwave", "wave"]), meant_names("bicycle", ["boiler"])
    (('microwave',), ())
    >>> meant_names("fridg", ["mini fridge", "fruit"])
    ('mini fridge',)
    >>> meant_names("living room", ["living", "bath"]), meant_names("R0", ["R(0)", "R(1)"])
    (('living',), ('R(0)',))
    """
    listed = {words: one for one in known if (words := _split_words(one))}
    said = _split_words(name)
    joined = {words.replace(" ", ""): words for words in listed}
    near = difflib.get_close_matches(said.replace(" ", ""), joined, n=most, cutoff=LIKE)
    found = [joined[one] for one in near]
    found += sorted((one for one in listed if f" {one} " in f" {said} "), key=len, reverse=True)
    if len(said) >= BEGUN:
        found += sorted((one for one in listed if f" {said}" in f" {one}"), key=len)
    return tuple(listed[one] for one in dict.fromkeys(found))[:most]


def _split_words(name: str) -> str:
    """Return the words of a name in small letters, with a space between them.

    >>> _split_words("R(0)"), _split_words("Mini-Fridge")
    ('r 0', 'mini fridge')
    """
    return " ".join(re.findall(r"[^\W_]+", name[:SHOWN].casefold()))


def ask_if_meant(name: str, known: Iterable[str], *, most: int = 1) -> str:
    """Return the question whether a similar name was meant; empty if none is similar.

    >>> ask_if_meant("ratoi", ["ratio", "random"])
    'did you mean ratio?'
    """
    near = meant_names(name, known, most=most)
    return f"did you mean {', '.join(near)}?" if near else ""


def show_value(value: object) -> str:
    """Return what a caller gave instead of what was expected, in at most `SHOWN` characters.

    >>> show_value("half"), show_value([1, 2]), show_value(10**400)
    ("'half'", '[1, 2]', 'an integer of more than 80 digits')
    """
    if isinstance(value, int) and abs(value) >= 10**SHOWN:  # Python refuses to print larger ones
        return f"an integer of more than {SHOWN} digits"
    try:
        return repr(value)[:SHOWN]
    except Exception:  # an integer too large within it, or a class of the caller's
        return f"a {type(value).__name__}"
