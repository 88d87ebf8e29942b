"""What a name means that no class map lists: the rules of number, hyphen, synonym and head noun.

A robot says `house-plants` where HM3D says `plant`. The rules are tried one after another, and each
form that they make is looked up again. Which rule decided is always reported.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Literal

Rule = Literal["separator", "number", "synonym", "head noun"]
RULES: Mapping[Rule, str] = {
    "separator": "hyphens and underscores are spaces: `TV-stand` is `tv stand`",
    "number": "the last word in the singular or plural: `sofas` is `sofa`",
    "synonym": "another word for the same thing, as mappings/synonyms-v1.csv lists",
    "head noun": "the last word alone, or the last before `of`, `with` or `for`, if that is a "
    "class: `leather armchair` is `armchair`",
}
# What follows one of these tells what kind of the thing before it is meant.
_PREPOSITION = re.compile(r"\s(?:with|without|for|of)\s")
# A number of things is of the things' class (rule 3 of mappings/README.md).
_COLLECTION = re.compile(r"^(?:an? )?(?:sets?|pairs?|piles?|stacks?|bunch|group|row) of ")
# (ending of the plural, ending of the singular)
_ENDINGS = (("ies", "y"), ("ves", "f"), ("ves", "fe"), ("es", ""), ("s", ""))


def resolve(
    name: str, *, synonyms: Mapping[str, str], known: Callable[[str], bool]
) -> Iterator[tuple[str, Rule]]:
    """Yield other names for a thing, with the rule that gives each, most literal first.

    Args:
        name: normalised; it is not listed itself.
        synonyms: normalised name → listed name.
        known: says whether a name is listed.
    """
    spaced = " ".join(re.sub(r"[-_]", " ", name).split())
    if spaced != name and known(spaced):
        yield spaced, "separator"
    forms = [spaced, *change_number(spaced)]
    yield from ((form, "number") for form in forms[1:] if known(form))
    yield from ((synonyms[form], "synonym") for form in forms if form in synonyms)
    head = find_head(spaced)
    if head != spaced:
        for form in (head, *change_number(head)):
            if known(form):
                yield form, "head noun"
            elif form in synonyms:
                yield synonyms[form], "head noun"


def change_number(name: str) -> tuple[str, ...]:
    """Return what can be the singular or the plural of a name; not each of them is a word.

    >>> change_number("bookshelves")
    ('bookshelf', 'bookshelfe', 'bookshelv', 'bookshelve', 'bookshelvess')
    """
    singular = [
        name.removesuffix(plural) + ending
        for plural, ending in _ENDINGS
        if name.endswith(plural) and len(name) > len(plural) + 1
    ]
    return (*singular, f"{name}s")


def find_head(name: str) -> str:
    """Return the noun that a name is about.

    >>> find_head("leather armchair"), find_head("basket of towels"), find_head("pile of towels")
    ('armchair', 'basket', 'towels')
    """
    thing = _PREPOSITION.split(_COLLECTION.sub("", name), maxsplit=1)[0]
    return thing.split()[-1] if thing.split() else name
