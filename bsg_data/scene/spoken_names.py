"""Resolve names that no class map lists: a robot says `house-plants` where HM3D says `plant`.

The rules are tried in this order; each resulting form is looked up, and the deciding rule reported:

- separator: hyphens, underscores and spaces are alike, and a number at the end says nothing:
  `TV-stand_3` is `tv stand`, `bed side table` is `bedside table`;
- number: the last word in the singular or plural: `sofas` is `sofa`;
- synonym: another word for the same thing, as mappings/synonyms-v1.csv lists;
- head noun: the last words alone, the longest first, or those before `of`, `with` or `for`:
  `leather armchair` is `armchair`. Only if that is a class.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Literal

Rule = Literal["separator", "number", "synonym", "head noun"]
RULES_VERSION = b"rules 1"  # of what is below: it is in the hash of every class map with rules
# What follows one of these tells what kind of the thing before it is meant.
_PREPOSITION = re.compile(r"\s(?:with|without|for|of)\s")
# A number of things is of the things' class (rule 3 of mappings/README.md).
_COLLECTION = re.compile(r"^(?:an? )?(?:sets?|pairs?|piles?|stacks?|bunch|group|row) of ")
# (ending of the plural, ending of the singular)
_ENDINGS = (("ies", "y"), ("ves", "f"), ("ves", "fe"), ("es", ""), ("s", ""))
_MOST_WORDS = 12  # no name of a thing has more


def resolve(
    name: str, synonyms: Mapping[str, str], *, known: Callable[[str], bool]
) -> Iterator[tuple[str, Rule]]:
    """Yield the listed names that a name can stand for, with the rule that gives each.

    Nothing comes after a name that is listed itself, or that `synonyms` (name → listed name) leads
    to the empty name: its last word misleads. The name is normalised, and not `known` itself.
    """
    # without the number at the end, as of `chair 3`, `chair #3` and `chair.003`
    bare = re.sub(r"[-_]", " ", name).rstrip(" .").rstrip("0123456789").rstrip(" .#")
    words = bare.split()[:_MOST_WORDS]
    if whole := tuple(_explain(words, synonyms, known)):
        yield from ((other, rule) for other, rule in whole if other)
        return
    for tail in _tails(words):
        if found := tuple(_explain(tail, synonyms, known)):
            yield from ((other, "head noun") for other, _ in found[:1] if other)
            return


def _explain(
    words: list[str], synonyms: Mapping[str, str], known: Callable[[str], bool]
) -> Iterator[tuple[str, Rule]]:
    """Yield what some words can stand for as they are: the empty name for a name that misleads."""
    spaced = " ".join(words)
    joined = (
        " ".join([*words[:i], words[i] + words[i + 1], *words[i + 2 :]])
        for i in range(len(words) - 1)
    )
    forms: list[tuple[str, Rule]] = [(spaced, "separator"), *((j, "separator") for j in joined)]
    forms += [(form, "number") for form in _change_number(spaced)]
    for form, rule in forms:
        if form in synonyms:
            yield synonyms[form], "synonym"
        elif known(form):
            yield form, rule


def _tails(words: list[str]) -> Iterator[list[str]]:
    """Yield the last words of what a name is about, the longest first, but not the whole name.

    It is about the `basket` of a `basket of towels`, and the `towels` of a `pile of towels`.
    """
    head = _PREPOSITION.split(_COLLECTION.sub("", " ".join(words)), maxsplit=1)[0].split()
    yield from (head[i:] for i in range(int(head == words), len(head)))


def singulars(name: str) -> Iterator[str]:
    """Yield what can be the singular of a name; not each is a word."""
    for plural, ending in _ENDINGS:
        if name.endswith(plural) and len(name) > len(plural) + 1:
            yield name.removesuffix(plural) + ending


def _change_number(name: str) -> tuple[str, ...]:
    """Return what can be the singular or the plural of a name; not each is a word."""
    return (*singulars(name), f"{name}s")
