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
    """Return the known names that a misspelt or cut off name may stand for, the most like first.

    Unlike the nearest names, they are more than names that share letters.

    >>> meant_names("microwav", ["microwave", "wave"]), meant_names("bicycle", ["boiler"])
    (('microwave',), ())
    >>> meant_names("fridg", ["mini fridge", "fruit"])
    ('mini fridge',)
    """
    listed, said = {one[:SHOWN].casefold(): one for one in known}, name[:SHOWN].casefold()
    near = difflib.get_close_matches(said, listed, n=most, cutoff=LIKE)
    if len(said) >= BEGUN:
        word = re.compile(rf"\b{re.escape(said)}")
        near += sorted(filter(word.search, listed), key=len)
    return tuple(listed[one] for one in dict.fromkeys(near))[:most]


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
