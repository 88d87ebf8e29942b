"""The words that detectors, simulators and data sets use for things.

`mappings/vocabularies-v1.csv` has `vocabulary,word,category`: each word of each vocabulary, as it
is published, with HM3D's word for it. A word without a category names nothing that HM3D names, and
so no words of it are taken alone: a `baseball glove` is no glove.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache

from bsg_data.errors import RecipeError
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.normal import take_apart
from bsg_data.words.shown import SHOWN

VOCABULARIES = "vocabularies-v1.csv"


@cache
def _read() -> Mapping[str, tuple[tuple[str, str], ...]]:
    """Return (word, category) of each vocabulary, by its name."""
    found: dict[str, list[tuple[str, str]]] = {}
    rows = read_rows(VOCABULARIES, read_published(VOCABULARIES), ("vocabulary", "word", "category"))
    for _, (name, word, category) in rows:
        found.setdefault(name, []).append((word, category))
    return {name: tuple(words) for name, words in found.items()}


def list_vocabularies() -> tuple[str, ...]:
    """Return the names of the vocabularies, sorted."""
    return tuple(sorted(_read()))


def vocabulary_words(name: str) -> tuple[str, ...]:
    """Return the words of a vocabulary as they are published, in its order: `coco` has 80.

    Raises:
        RecipeError: if there is no such vocabulary.
    """
    known = list_vocabularies()
    if name.casefold() not in known:
        asked = f"{ask_if_meant(name, known)} there are {', '.join(known)}".lstrip()
        raise RecipeError(
            f"no vocabulary {name[:SHOWN]!r}: {asked}", code="vocabulary-unknown", where=name
        )
    return tuple(word for word, _ in _read()[name.casefold()])


def list_meanings() -> Iterator[tuple[str, str]]:
    """Yield every word of every vocabulary with HM3D's word for it, or none.

    A word in camel case or with brackets comes twice: `CoffeeTable` and `Coffee Table`.
    """
    for words in _read().values():
        for word, category in words:
            yield word, category
            if (apart := take_apart(word)) != word:
                yield apart, category
