"""Typos: one letter too many, missing or wrong, or two that are swapped; never the first."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping

from bsg_data.words.normal import drop_number, separate

SHORT = 5  # letters: nearly every name that is no longer resembles another one
_LONG = 30  # letters: no word of a name has more
_SHORT_WORD = 4  # letters of the shortest word that a longer one can be a typo of


def is_typo(said: str, word: str) -> bool:
    """Say whether one letter is too many, missing or wrong, or two are swapped; not the first.

    >>> is_typo("micorwave", "microwave"), is_typo("toilett", "toilet"), is_typo("xbox", "box")
    (True, True, False)
    """
    if said == word or said[:1] != word[:1] or abs(len(said) - len(word)) > 1:
        return False
    at = next((i for i, (a, b) in enumerate(zip(said, word, strict=False)) if a != b), len(said))
    a, b = said[at:], word[at:]
    swapped = a[:2] == b[1::-1] and a[2:] == b[2:]
    return swapped or a[1:] == b[1:] or a[1:] == b or a == b[1:]


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


def near_words(said: str, index: Mapping[str, list[str]]) -> list[str]:
    """Return the words of an index (`index_words`) of which a word is a typo, sorted."""
    if not SHORT <= len(said) <= _LONG or said in index.get(said, ()):
        return []
    near = {word for left in index.keys() & _leave_out(said) for word in index[left]}
    return sorted(word for word in near if is_typo(said, word))


def mend(name: str, index: Mapping[str, list[str]], *, real: Container[str]) -> Iterator[str]:
    """Yield a normalised name with one word mended by one that is in the index of known words.

    A word that is `real`, or short, is taken as it is.
    """
    words = drop_number(separate(name)).split()
    if len("".join(words)) <= SHORT:
        return
    for i, said in enumerate(words):
        for word in () if said in real else near_words(said, index):
            yield " ".join([*words[:i], word, *words[i + 1 :]])
