"""Resolve names that no class map lists: a robot says `house-plants` where HM3D says `plant`.

The rules are tried in this order; each resulting form is looked up, and the deciding rule reported:

- separator: hyphens, underscores and spaces are alike, `CoffeeTable` and `coffeetable` are
  `coffee table`, and a number at the end says nothing: `TV-stand_3` is `tv stand`, `bed side table`
  is `bedside table`;
- vocabulary: a word of a published vocabulary, as mappings/vocabularies-v1.csv lists;
- synonym: another word for the same thing, as mappings/synonyms-v1.csv lists;
- number: the last word in the singular or plural: `sofas` is `sofa`;
- head noun: the last words alone, the longest first, or those before `of`, `with` or `for`:
  `leather armchair` is `armchair`. Only if that is a class;
- phrase: what is said of a thing is left out: where it is, a score, what stands in brackets or
  behind a comma; of names with a slash between, the first with a class counts:
  `lamp on table`, `lamp (0.87)` and `lamp/table` are `lamp`;
- spelling: one typo in one word that is no word of English: `toilett` is `toilet`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import takewhile
from operator import itemgetter
from typing import Literal

Rule = Literal["separator", "vocabulary", "number", "synonym", "head noun", "phrase", "spelling"]
RULES_VERSION = b"rules 1"  # of what is below: it is in the hash of every class map
# What follows one of these tells what kind of the thing before it is meant.
_PREPOSITION = re.compile(r"\s(?:with|without|for|of)\s")
# A number of things is of the things' class (rule 3 of mappings/README.md).
_COLLECTION = re.compile(r"^(?:an? )?(?:sets?|pairs?|piles?|stacks?|bunch|group|row) of ")
# What is said of a thing: behind a comma or in brackets, how sure it is, and where it is.
_REMARK = re.compile(r"[(\[{<][^)\]}>]*[)\]}>]?|(?:,|;\s).*")
_SCORE = re.compile(r"[\s_:=@]+(?:[01]?\.[0-9]+|[0-9]{1,3} ?%)\s*$")
_EITHER = re.compile(r"[/|](?!\d)|(?<!\d)[/|]")
_WITH = re.compile(r"\bw/(?=\W*\w)|/w\b", re.IGNORECASE)
MARKS = " ?!.,;:…*\"'`“”„‘’«»‹›()[]{}<>¿¡？"  # around a name that was copied from a sentence
_PLACE = re.compile(
    r"\s(?:(?:is|are|hanging|lying|standing|sitting|placed|mounted|leaning|resting|stacked)\s)*"
    r"(?:on|in|under|underneath|beneath|below|behind|beside|near|next to|by|at|from|above|over"
    r"|against|between|inside|outside|atop|upon|within|along|around|opposite|in front of|close to"
    r")\s(?=\w)",
    re.IGNORECASE,
)
# Words that make one word with `in` or `on`: a carry on bag is on nothing.
# fmt: off
_ONE_WORD = frozenset({
    "add", "all", "built", "carry", "clip", "drop", "fold", "hands", "left", "lift", "log", "plug",
    "pop", "pull", "push", "ride", "roll", "screw", "sit", "slip", "snap", "stand", "step", "stick",
    "trade", "tuck", "walk",
})
# fmt: on
# Between the words of `CoffeeTable` and of `TVStand`.
_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
# (ending of the plural, ending of the singular)
_ENDINGS = (("ies", "y"), ("ves", "f"), ("ves", "fe"), ("es", ""), ("s", ""))
_MOST_WORDS = 12  # no name of a thing has more
SHORT = 5  # letters: nearly every name that is no longer resembles another one
LONGEST = 100  # characters of a name: a longer one names nothing that we know
_LONG = 30  # letters: no word of a name has more
_SHORT_WORD = 4  # letters of the shortest word that a longer one can be a typo of


def resolve(
    names: Sequence[str],
    synonyms: Mapping[str, str],
    *,
    known: Callable[[str], bool],
    vocabulary: Container[str] = (),
    most_words: int = _MOST_WORDS,
    is_whole: bool = False,
) -> Iterator[tuple[str, Rule]]:
    """Yield the listed names that a name can stand for, with the rule that gives each.

    Nothing comes after a name that is listed itself, or that `synonyms` (name → listed name) leads
    to the empty name: its last word misleads. `names` are readings of one name, normalised, the
    best first: as it is, and taken apart. None is `known` itself. `vocabulary`
    has the synonyms that are words of a vocabulary. No listed name has more than `most_words`.
    `is_whole` leaves out the rule of the head noun.
    """
    readings = [_split(name) for name in names]
    for words in readings:
        if whole := tuple(_explain(words, synonyms, known, vocabulary, most_words)):
            yield from takewhile(itemgetter(0), whole)
            return
    for words in () if is_whole else readings:
        for tail in list_tails(words):
            if found := tuple(_explain(tail, synonyms, known, vocabulary, most_words)):
                yield from ((other, "head noun") for other, _ in found[:1] if other)
                return


@lru_cache(maxsize=64)  # every rule asks again
def take_apart(name: str) -> str:
    """Return a name with spaces for its brackets, and between the words of its camel case.

    >>> take_apart("CoffeeTable"), take_apart("TVStand"), take_apart("TV (old)")
    ('Coffee Table', 'TV Stand', 'TV  old ')
    """
    return _CAMEL.sub(" ", re.sub(r"[()]", " ", name))


@lru_cache(maxsize=4096)  # the objects of a map are asked again and again
def list_parts(name: str) -> tuple[str, ...]:
    """Return the names of what a name is about, without what it says of them; itself if no more.

    >>> list_parts("box under bed"), list_parts("Cabinet/shelf"), list_parts("chair(0.87)")
    (('box',), ('Cabinet', 'shelf'), ('chair',))
    >>> list_parts("mug, red"), list_parts("walk in closet"), list_parts("end of bed bench")
    (('mug',), ('walk in closet',), ('end of bed bench',))
    """
    if len(name) > LONGEST:
        return (name,)
    bare = _REMARK.sub(" ", _SCORE.sub("", _WITH.sub(" with ", name)))
    pieces = (_drop_place(one).strip(MARKS) for one in _EITHER.split(bare))
    return tuple(filter(None, pieces)) or (name.strip(MARKS),)


def _drop_place(name: str) -> str:
    spaced = name.replace("_", " ")
    for found in _PLACE.finditer(spaced):
        before = spaced[: found.start()].split()
        if before and before[-1].casefold() not in _ONE_WORD:
            return name[: found.start()]
    return name


@lru_cache(maxsize=64)
def separate(name: str) -> str:
    """Return a normalised name with spaces for hyphens and underscores.

    >>> separate("tv_monitor")
    'tv monitor'
    """
    return " ".join(re.sub(r"[-_]", " ", name).split())


def _split(name: str) -> list[str]:
    """Return the words of a name without the number at the end, as of `chair #3`, `chair.003`."""
    bare = separate(name).rstrip(" .").rstrip("0123456789").rstrip(" .#")
    return bare.split()[:_MOST_WORDS]


def _explain(
    words: list[str],
    synonyms: Mapping[str, str],
    known: Callable[[str], bool],
    vocabulary: Container[str],
    most_words: int,
) -> Iterator[tuple[str, Rule]]:
    """Yield what some words can stand for as they are: the empty name for a name that misleads."""
    if len(words) > most_words + 1:  # two words may be written as one
        return
    spaced = " ".join(words)
    joined = (
        " ".join([*words[:i], words[i] + words[i + 1], *words[i + 2 :]])
        for i in range(len(words) - 1)
    )
    forms: list[tuple[str, Rule]] = [(spaced, "separator"), *((j, "separator") for j in joined)]
    forms += [(form, "number") for form in change_number(spaced)]
    for form, rule in forms:
        if form in synonyms:
            yield synonyms[form], _name_rule(form, synonyms[form], vocabulary)
        elif known(form):
            yield form, rule


def _name_rule(form: str, other: str, vocabulary: Container[str]) -> Rule:
    """Name the rule by which another word is a synonym."""
    if other.replace(" ", "") == form:
        return "separator"
    return "vocabulary" if form in vocabulary else "synonym"


def list_tails(words: list[str]) -> Iterator[list[str]]:
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


def change_number(name: str) -> tuple[str, ...]:
    """Return what can be the singular or the plural of a name; not each is a word."""
    return (*singulars(name), f"{name}s")


def is_typo(said: str, word: str) -> bool:
    """Say whether one letter is too many, missing or wrong, or two are swapped; not the first.

    >>> is_typo("micorwave", "microwave"), is_typo("toilett", "toilet"), is_typo("xbox", "box")
    (True, True, False)
    """
    if said == word or said[:1] != word[:1] or abs(len(said) - len(word)) > 1:
        return False
    at = next((i for i, (a, b) in enumerate(zip(said, word, strict=False)) if a != b), len(said))
    if len(said) != len(word):
        longer, shorter = sorted((said, word), key=len, reverse=True)
        at = min(at, len(shorter))
        return longer[at + 1 :] == shorter[at:]
    swapped = said[at : at + 2] == word[at : at + 2][::-1] and said[at + 2 :] == word[at + 2 :]
    return swapped or said[at + 1 :] == word[at + 1 :]


def index_words(names: Iterable[str]) -> dict[str, list[str]]:
    """Return the words of names by what is left of each without one of its letters."""
    words = {
        word
        for name in names
        for word in name.split()
        if _SHORT_WORD <= len(word) <= _LONG + 1  # no other is a typo away from one that is mended
    }
    index: dict[str, list[str]] = {}
    for word in sorted(words):
        for left in _leave_out(word):
            index.setdefault(left, []).append(word)
    return index


def _leave_out(word: str) -> set[str]:
    """Return a word, and what is left of it without one of its letters."""
    return {word, *(word[:i] + word[i + 1 :] for i in range(len(word)))}


def mend(name: str, index: Mapping[str, list[str]], *, real: Container[str]) -> Iterator[str]:
    """Yield a normalised name with one word mended by one that is in the index of known words.

    A word that is `real`, or short, is taken as it is.
    """
    words = _split(name)
    if len("".join(words)) <= SHORT:
        return
    for i, said in enumerate(words):
        if not SHORT <= len(said) <= _LONG or said in real or said in index.get(said, ()):
            continue
        near = {word for left in index.keys() & _leave_out(said) for word in index[left]}
        for word in sorted(near):
            if is_typo(said, word):
                yield " ".join([*words[:i], word, *words[i + 1 :]])
