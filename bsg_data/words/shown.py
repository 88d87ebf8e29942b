"""Show names and values in messages, however long they are."""

from __future__ import annotations

from collections.abc import Sequence

SHOWN = 80  # characters of a wrong name that are compared, and shown in errors


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
