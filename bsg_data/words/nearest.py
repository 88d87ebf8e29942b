"""Known names that are spelled alike: the nearest ones, and those of which a word is a typo.

A typo is one letter too many, missing or wrong, or two that are swapped; never the first.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Container, Iterable, Iterator

from bsg_data.words.normal import drop_number, separate
from bsg_data.words.shown import SHOWN

# difflib's ratio: keeps shoos for shoes and vaze for vase; not mobile for bicycle
_LEAST_LIKENESS = 0.75
_FEWEST_LETTERS = 4  # letters by which a word of a name is known
SHORT = 5  # letters: nearly every name that is no longer resembles another one
_LONG = 30  # letters: no word of a name has more
_SHORT_WORD = 4  # letters of the shortest word that a longer one can be a typo of


def nearest_names(name: str, known: Iterable[str], *, most: int = 3) -> tuple[str, ...]:
    """Return the known names that a misspelt, longer or cut off name may stand for, the best first.

    >>> nearest_names("microwav", ["microwave", "wave"]), nearest_names("bicycle", ["boiler"])
    (('microwave',), ())
    >>> nearest_names("living room", ["living", "bath"]), nearest_names("fridg", ["mini fridge"])
    (('living',), ('mini fridge',))
    """
    listed = {words: name for name in known if (words := _split_words(name))}
    spoken = _split_words(name)
    joined = {words.replace(" ", ""): words for words in listed}
    near = difflib.get_close_matches(
        spoken.replace(" ", ""), joined, n=most, cutoff=_LEAST_LIKENESS
    )
    longer = [words for words in listed if f" {words} " in f" {spoken} "]
    cut_off = [
        words for words in listed if len(spoken) >= _FEWEST_LETTERS and f" {spoken}" in f" {words}"
    ]
    long = [word for word in spoken.split() if len(word) > SHORT]
    mended = [words for words in listed if any(is_typo(word, words) for word in long)]
    found = [joined[letters] for letters in near] + sorted(longer, key=len, reverse=True)
    found += mended + sorted(cut_off, key=len)
    return tuple(listed[words] for words in dict.fromkeys(found))[:most]


def _split_words(name: str) -> str:
    return " ".join(re.findall(r"[^\W_]+", name[:SHOWN].casefold()))


def ask_if_meant(name: str, known: Iterable[str], *, most: int = 1) -> str:
    """Return the question whether a similar name was meant; empty if none is similar."""
    near = nearest_names(name, known, most=most)
    return f"did you mean {', '.join(near)}?" if near else ""


def is_typo(spelled: str, word: str) -> bool:
    """Say whether one letter is too many, missing or wrong, or two are swapped; not the first.

    >>> is_typo("micorwave", "microwave"), is_typo("toilett", "toilet"), is_typo("xbox", "box")
    (True, True, False)
    """
    if spelled == word or spelled[:1] != word[:1] or abs(len(spelled) - len(word)) > 1:
        return False
    at = next(
        (i for i, (a, b) in enumerate(zip(spelled, word, strict=False)) if a != b), len(spelled)
    )
    a, b = spelled[at:], word[at:]
    swapped = a[:2] == b[1::-1] and a[2:] == b[2:]
    return swapped or a[1:] == b[1:] or a[1:] == b or a == b[1:]


class Spellings:
    """The words of names, to find the one of which a word is a typo."""

    def __init__(self, names: Iterable[str]) -> None:
        """Keep the words of names that a longer word can be a typo of."""
        self._words: dict[str, list[str]] = {}  # by their first letter, which is never wrong
        for word in sorted({*" ".join(names).split()}):
            if _SHORT_WORD <= len(word) <= _LONG + 1:
                self._words.setdefault(word[0], []).append(word)
        self._indices: dict[str, dict[str, list[str]]] = {}

    def near(self, spelled: str) -> list[str]:
        """Return the words of which a word is a typo, sorted; none if it is one of them."""
        index = self._index(spelled[:1]) if SHORT <= len(spelled) <= _LONG else {}
        if spelled in index.get(spelled, ()):
            return []
        near = {word for less in index.keys() & _leave_out(spelled) for word in index[less]}
        return sorted(word for word in near if is_typo(spelled, word))

    def mend(self, name: str, *, real: Container[str]) -> Iterator[str]:
        """Yield a normalised name with one word mended by one of these.

        A word that is `real`, or short, is taken as it is.
        """
        words = drop_number(separate(name)).split()
        if len("".join(words)) <= SHORT:
            return
        for i, spelled in enumerate(words):
            for word in () if spelled in real else self.near(spelled):
                yield " ".join([*words[:i], word, *words[i + 1 :]])

    def _index(self, letter: str) -> dict[str, list[str]]:
        """Return the words with a first letter, by what is left of each without one of its own."""
        if letter not in self._indices:
            index: dict[str, list[str]] = {}
            for word in self._words.get(letter, ()):
                for less in _leave_out(word):
                    index.setdefault(less, []).append(word)
            self._indices[letter] = index
        return self._indices[letter]


def _leave_out(word: str) -> set[str]:
    """Return a word, and what is left of it without one of its letters."""
    return {word, *(word[:i] + word[i + 1 :] for i in range(len(word)))}
