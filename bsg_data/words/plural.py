"""Singular and plural of English names."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

# (ending of the plural, ending of the singular)
_ENDINGS = (("ies", "y"), ("ves", "f"), ("ves", "fe"), ("es", ""), ("s", ""))
_IRREGULAR = {"children": "child", "people": "person"}


def singulars(name: str) -> Iterator[str]:
    """Yield what can be the singular of a name; not each is a word."""
    for plural, ending in _ENDINGS:
        if name.endswith(plural) and len(name) > len(plural) + 1:
            yield name.removesuffix(plural) + ending


def change_number(name: str) -> tuple[str, ...]:
    """Return what can be the singular or the plural of a name; not each is a word."""
    return (*singulars(name), f"{name}s")


@lru_cache(maxsize=1024)  # the words of names of rooms are few
def make_singular(word: str) -> str:
    """Return the likeliest singular of a word; itself if it is one.

    >>> [make_singular(word) for word in ("children", "studies", "benches", "boxes", "office")]
    ['child', 'study', 'bench', 'box', 'office']
    """
    if word.endswith("ies"):
        return f"{word[:-3]}y"
    if word.endswith(("ches", "shes", "sses", "xes")):
        return word[:-2]
    is_plural = len(word) > 3 and word.endswith("s") and not word.endswith(("ss", "us", "is"))
    return _IRREGULAR.get(word, word[:-1] if is_plural else word)
