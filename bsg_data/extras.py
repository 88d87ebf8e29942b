"""How to install the packages of an extra: the one place that says it."""

from __future__ import annotations


def ask_to_install(extra: str) -> str:
    """Return the command that installs an extra, as errors end.

    It names a place, never the bare name: on a package index, that name may be a stranger's.

    >>> ask_to_install("models")
    "pip install './belief-scene-graphs[models]' (the folder of your checkout, or your wheel file)"
    """
    where = "the folder of your checkout, or your wheel file"
    return f"pip install './belief-scene-graphs[{extra}]' ({where})"
