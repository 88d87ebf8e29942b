"""Find the known names that an unknown one may stand for."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from bsg_data.words.shown import SHOWN
from bsg_data.words.typo import SHORT, is_typo

# difflib's ratio: keeps shoos for shoes and vaze for vase; not mobile for bicycle
_LEAST_LIKENESS = 0.75
_FEWEST_LETTERS = 4  # letters by which a word of a name is known


def nearest_names(name: str, known: Iterable[str], *, most: int = 3) -> tuple[str, ...]:
    """Return the known names that a misspelt, longer or cut off name may stand for, the best first.

    >>> nearest_names("microwav", ["microwave", "wave"]), nearest_names("bicycle", ["boiler"])
    (('microwave',), ())
    >>> nearest_names("living room", ["living", "bath"]), nearest_names("fridg", ["mini fridge"])
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
    long = [word for word in said.split() if len(word) > SHORT]
    mended = [words for words in listed if any(is_typo(word, words) for word in long)]
    found = [joined[one] for one in near] + sorted(longer, key=len, reverse=True)
    found += mended + sorted(cut_off, key=len)
    return tuple(listed[words] for words in dict.fromkeys(found))[:most]


def _split_words(name: str) -> str:
    return " ".join(re.findall(r"[^\W_]+", name[:SHOWN].casefold()))


def ask_if_meant(name: str, known: Iterable[str], *, most: int = 1) -> str:
    """Return the question whether a similar name was meant; empty if none is similar."""
    near = nearest_names(name, known, most=most)
    return f"did you mean {', '.join(near)}?" if near else ""
