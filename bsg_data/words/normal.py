"""The forms in which names are compared."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache

LONGEST = 100  # characters of a name: a longer one names nothing that we know
MARKS = " ?!.,;:…*\"'`“”„‘’«»‹›()[]{}<>¿¡？"  # around a name that was copied from a sentence
_END = "\0"  # of a name in a text of many
# Between the words of `CoffeeTable` and of `TVStand`, but not of `DVDs`.
_CAMEL = re.compile(r"(?<=[^\W_A-Z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})")


@lru_cache(maxsize=64)  # every rule normalises a name again
def normalise_name(name: str) -> str:
    """Return `name` as NFC, casefolded, trimmed, runs of white space as one space."""
    return " ".join(unicodedata.normalize("NFC", name).casefold().split())


def normalise_names(names: Sequence[str]) -> list[str]:
    """Return the names of a table, normalised all at once."""
    text = _END.join(names)
    if text.count(_END) + 1 != len(names):  # none, or a name that has such a character
        return [*map(normalise_name, names)]
    spelled = unicodedata.normalize("NFC", text).casefold()
    return [" ".join(name.split()) for name in spelled.split(_END)]


def separate(name: str) -> str:
    """Return a normalised name with spaces for hyphens and underscores.

    >>> separate("TV_monitor")
    'tv monitor'
    """
    return normalise_name(name.replace("-", " ").replace("_", " "))


def separate_names(names: Sequence[str]) -> list[str]:
    """Separate the names of a table, all at once."""
    return normalise_names([name.replace("-", " ").replace("_", " ") for name in names])


def drop_number(name: str) -> str:
    """Return a name without the number at its end, as of `chair #3` and `chair.003`."""
    return name.rstrip(" .").rstrip("0123456789").rstrip(" .#")


@lru_cache(maxsize=64)  # every rule asks again
def take_apart(name: str) -> str:
    """Return a name with spaces for its brackets, and between the words of its camel case.

    >>> take_apart("CoffeeTable"), take_apart("TVStand"), take_apart("TV (old)")
    ('Coffee Table', 'TV Stand', 'TV  old ')
    """
    return split_camel(re.sub(r"[()]", " ", name))


def split_camel(name: str) -> str:
    """Return a name with spaces between the words of its camel case."""
    return _CAMEL.sub(" ", name)
