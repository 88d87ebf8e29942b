"""Find the known names that are most similar to an unknown one."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

SHOWN = 80  # characters of a wrong name that are compared, and shown in errors


def nearest_names(name: str, known: Iterable[str], *, most: int = 3) -> tuple[str, ...]:
    """Return the known names that are most like a name, the most like first; case is ignored.

    No more than `SHOWN` characters are compared, so that a name of any length is answered at once.

    >>> nearest_names("Kitchn", ["kitchen", "hall", "KITCHENETTE"])
    ('kitchen', 'KITCHENETTE')
    """
    listed = {one[:SHOWN].casefold(): one for one in known}
    near = difflib.get_close_matches(name[:SHOWN].casefold(), listed, n=most)
    return tuple(listed[one] for one in near)


def ask_if_meant(name: str, known: Iterable[str], *, most: int = 1) -> str:
    """Return the question whether a similar name was meant; empty if none is similar.

    >>> ask_if_meant("ratoi", ["ratio", "random"])
    'did you mean ratio?'
    """
    near = nearest_names(name, known, most=most)
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
