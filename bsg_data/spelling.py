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
