"""Other words for what a class map lists: synonyms, and the words of vocabularies.

`mappings/synonyms-v1.csv` has `name,category`: another word, and HM3D's.
`mappings/vocabularies-v1.csv` has `vocabulary,word,category`: each word of each vocabulary of
detectors, simulators and data sets, as it is published, with HM3D's word for it. A word without a
category names nothing that HM3D names, and so no words of it are taken alone: a `baseball glove` is
no glove.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from typing import Literal

from bsg_data.errors import RecipeError
from bsg_data.scene.class_space import read_columns
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.normal import change_number, list_tails, normalise_names, separate, take_apart
from bsg_data.words.shown import SHOWN

Rule = Literal["separator", "vocabulary", "number", "synonym", "head noun", "phrase", "spelling"]
UNKNOWN = "unknown"  # the category of a nameless object
_SYNONYMS, _VOCABULARIES = "synonyms-v1.csv", "vocabularies-v1.csv"
_REAL_WORDS = "real-words-v1.csv"
_HM3D = "hm3d45-v1.csv"  # its names and their classes
RULE_FILES = (_SYNONYMS, _VOCABULARIES, _REAL_WORDS)  # by which names are read that no map lists


def list_synonyms(listed: Mapping[str, tuple[str, str]]) -> dict[str, tuple[str, Rule]]:
    """Return other words for what a map lists → the listed name, and the rule that says so.

    A word leads to the empty name if no words of it are to be taken alone. A map need not list
    HM3D's word: another listed name of the same category does, or for a word of a vocabulary the
    plural or the head noun, if both have one class of HM3D.

    Args:
        listed: normalised name → category and class; empty without one.
    """
    vocabulary, called = _read_vocabulary(), _name_meanings(listed)
    found = dict(called)
    for name, category in {**_read_synonyms(), **vocabulary}.items():
        wider = _list_wider(name, category) if name in vocabulary else ()
        others = (other for other in (category, called.get(category), *wider) if other in listed)
        if (other := next(others, None)) or not category or name in vocabulary:
            found[name] = other or ""
    for name, other in {**{name: name for name in listed}, **found}.items():
        if " " in name:  # `diningtable` is `dining table`
            found.setdefault(name.replace(" ", ""), other)

    def name_rule(word: str, other: str) -> Rule:
        is_apart = other.replace(" ", "") == word
        return "separator" if is_apart else "vocabulary" if word in vocabulary else "synonym"

    left = {word: other for word, other in found.items() if word not in listed}
    return {word: (other, name_rule(word, other)) for word, other in left.items()}


def _list_wider(word: str, category: str) -> Iterator[str]:
    """Yield plurals and last words of a word and of HM3D's, those of the same class there."""
    of_hm3d = _read_classes()
    for name in (category, word):
        tails = (" ".join(tail) for tail in list_tails(name.split()))
        for other in (*change_number(name), *tails):
            if of_hm3d.get(other) == of_hm3d[category] != "":
                yield other


def _name_meanings(listed: Mapping[str, tuple[str, str]]) -> dict[str, str]:
    """Return a listed name for each category, class and synonym that is not listed itself."""
    synonyms, meanings = _read_synonyms(), zip(*listed.values(), strict=True)
    meant = [*chain.from_iterable(meanings), *(synonyms.get(name, "") for name in listed)]
    found: dict[str, str] = {}
    for meaning, name in zip(normalise_names(meant), [*listed] * 3, strict=True):
        if meaning and meaning != UNKNOWN and meaning not in listed:
            found.setdefault(meaning, name)
    return found


@cache
def _read_classes() -> Mapping[str, str]:
    """Return the class of each of HM3D's names."""
    table = read_columns(_HM3D)
    return dict(zip(normalise_names(table["raw_category"]), table["class"], strict=True))


@cache
def _read_synonyms() -> Mapping[str, str]:
    return dict(zip(*map(normalise_names, read_columns(_SYNONYMS).values()), strict=True))


@cache
def _read_vocabulary() -> Mapping[str, str]:
    """Return HM3D's words by the words of all vocabularies, normalised, with spaces alone.

    A word in camel case or with brackets is there twice: `coffeetable` and `coffee table`.
    """
    table = read_columns(_VOCABULARIES)
    pairs = [*zip(table["word"], normalise_names(table["category"]), strict=True)]
    return {
        separate(spelling): meant for word, meant in pairs for spelling in (word, take_apart(word))
    }


def vocabulary_words(name: str) -> tuple[str, ...]:
    """Return the words of a vocabulary as they are published, in its order: `coco` has 80.

    Raises:
        RecipeError: if there is no such vocabulary.
    """
    names, words, _ = read_columns(_VOCABULARIES).values()
    known, asked = sorted({*names}), name.casefold()
    if asked not in known:
        hint = f"{ask_if_meant(name, known)} there are {', '.join(known)}".lstrip()
        raise RecipeError(
            f"no vocabulary {name[:SHOWN]!r}: {hint}", code="vocabulary-unknown", where=name
        )
    return tuple(word for word, of in zip(words, names, strict=True) if of == asked)


@cache
def read_real_words() -> frozenset[str]:
    """Return words of English that are one typo from a word of a name."""
    return frozenset(read_columns(_REAL_WORDS)["word"])
