"""Read which words are alike (GloVe), and which are things and of what kind (WordNet)."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from bsg_data.arrays import Floats
from bsg_data.words.plural import singulars
from bsg_robot.answers.nouns import split_head

SIZE = 38_000  # things, the most frequent
_MOST_OTHER = 5_000  # words before a head
# WordNet's lexicographer files of physical things, and how much a sense of each counts.
PHYSICAL = {6: 1.0, 13: 1.0, 27: 0.3, 17: 0.3, 20: 0.3, 21: 0.2, 10: 0.2, 8: 0.15, 5: 0.15}
MOST_FREQUENT = 400_000  # of GloVe that can be taken for things by their neighbours
_REFERENCE = 20_000  # of them are compared with
_NEIGHBOURS = 10
_WORD = re.compile("[a-z]{2,24}")
_FUNCTION_WORDS = 200  # the most frequent words: `in` and `he` are metals in WordNet, too
_LEAST_PHYSICAL = 0.1  # physical share of the senses of a thing: `second` is a unit of time first
_IS_THING = 0.3  # mean physical share of the neighbours of a name that WordNet lacks


@dataclass(frozen=True, eq=False)
class Lexicon:
    """GloVe's vectors and WordNet's nouns."""

    vectors: Floats  # [V, 50]
    rank: Mapping[str, int]  # word → row, the most frequent first
    senses: Mapping[str, Sequence[str]]  # noun → synsets, the most frequent first
    kinds: Mapping[str, int]  # synset → lexicographer file
    above: Mapping[str, Sequence[str]]  # synset → hypernyms
    named: Mapping[str, Sequence[str]]  # synset → single words for it and its hyponyms
    _known: dict[str, dict[str, float]] = field(default_factory=dict)

    def find(self, word: str) -> str | None:
        """Return the word, or its singular, that has a vector."""
        return next((one for one in (word, *singulars(word)) if one in self.rank), None)

    def physical(self, word: str) -> dict[str, float]:
        """Return the ancestors of the physical senses of a noun, with weights."""
        if word not in self._known:
            self._known[word] = self._weigh(word)
        return self._known[word]

    def physical_share(self, word: str) -> float:
        """Return how much of the senses of a word are things."""
        noun = next((one for one in (word, *singulars(word)) if one in self.senses), None)
        senses = self.senses.get(noun or "", ())
        total = sum(1 / place for place in range(1, len(senses) + 1))
        found = (
            min(PHYSICAL.get(self.kinds[sense], 0.0) / 0.5, 1.0) / place
            for place, sense in enumerate(senses, 1)
        )
        return sum(found) / total if total else 0.0

    def is_adopted(self, word: str) -> bool:
        """Return whether only its neighbours say that a word is a thing."""
        return bool(self.physical(word)) and not self._senses(word)

    def adopt_names(self) -> None:
        """Take names that WordNet lacks for things if what GloVe finds alike are: brands, gadgets.

        They get the ancestors of their neighbours. A misspelling of a neighbour is none.
        """
        ranked = list(self.rank)[:MOST_FREQUENT]
        known = ranked[:_REFERENCE]
        shares = np.array([self.physical_share(word) for word in known])
        new = [word for word in ranked if _WORD.fullmatch(word) and not self._senses(word)]
        unit = self.vectors / np.linalg.norm(self.vectors, axis=1, keepdims=True)
        reference = unit[: len(known)].T
        for start in range(0, len(new), 2000):
            some = new[start : start + 2000]
            likeness = unit[[self.rank[word] for word in some]] @ reference
            nearest = np.argpartition(-likeness, _NEIGHBOURS + 1)[:, : _NEIGHBOURS + 1]
            for word, rows in zip(some, nearest, strict=True):
                others = [row for row in sorted(rows) if known[row] != word][:_NEIGHBOURS]
                names = [known[row] for row in others]
                if shares[others].mean() >= _IS_THING and not get_close_matches(
                    word, names, 1, 0.8
                ):
                    self._known[word] = _mean_of([self.physical(name) for name in names])

    def _weigh(self, word: str) -> dict[str, float]:
        found: Counter[str] = Counter()
        for sense, weight in self._senses(word).items():
            for ancestor in self._ancestors(sense):
                found[ancestor] += weight
        return dict(found)

    def _senses(self, word: str) -> dict[str, float]:
        """Return the physical senses of a noun, with weights that sum to 1."""
        noun = next((one for one in (word, *singulars(word)) if one in self.senses), None)
        weights = {
            sense: PHYSICAL[self.kinds[sense]] / place
            for place, sense in enumerate(self.senses.get(noun or "", ()), 1)
            if self.kinds[sense] in PHYSICAL
        }
        return {sense: weight / sum(weights.values()) for sense, weight in weights.items()}

    def meaning(self, name: str) -> Floats:
        """Return the vector of a name, the mean of its words; 0 if none is known."""
        before, head = split_head(name)
        found = [self.rank[one] for part in (*before, head) if (one := self.find(part)) is not None]
        return self.vectors[found].mean(axis=0) if found else np.zeros(self.vectors.shape[1])

    @cached_property
    def relatives(self) -> Floats:
        """What things of the same kinds mean, `[V, 50]`; a word that is no thing means itself.

        The vector of `apple` is that of a company first; those of other fruits correct it, as in
        retrofitting (Faruqui et al., NAACL 2015).
        """
        found = self.vectors.copy()
        for word in self.senses.keys() & self.rank.keys():
            parts = [
                (w, v) for s, w in self._senses(word).items() if (v := self._kin(s)) is not None
            ]
            if parts:
                found[self.rank[word]] = np.average(
                    [vector for _, vector in parts], axis=0, weights=[weight for weight, _ in parts]
                )
        return found

    @cache  # noqa: B019 - a lexicon lives as long as the process
    def _kin(self, synset: str) -> Floats | None:
        """Return the mean vector of what a synset, its hyponyms and its siblings are called."""
        rows = [self.rank[w] for s in (synset, *self.above[synset]) for w in self.named.get(s, ())]
        return self.vectors[rows].mean(axis=0) if rows else None

    def _ancestors(self, synset: str) -> set[str]:
        found, todo = set(), [synset]
        while todo:
            one = todo.pop()
            if one not in found:
                found.add(one)
                todo += self.above[one]
        return found


def _mean_of(weighed: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the mean of those that are not empty."""
    found: Counter[str] = Counter()
    full = [one for one in weighed if one]
    for one in full:
        for name, weight in one.items():
            found[name] += weight / len(full)
    return dict(found)


def read_lexicon(glove: Path, wordnet: Path) -> Lexicon:
    """Read `glove_6B_index.parquet` and `glove_6B_50d_emb.npy`, and WordNet's noun files."""
    words = pd.read_parquet(glove / "glove_6B_index.parquet")["index"]
    vectors = np.load(glove / "glove_6B_50d_emb.npy", allow_pickle=False)
    senses, kinds, above = {}, {}, {}
    rank = {word: row for row, word in enumerate(words)}
    named: dict[str, list[str]] = defaultdict(list)
    for fields in _read_wordnet(wordnet / "index.noun"):
        senses[fields[0].replace("_", " ")] = fields[-int(fields[2]) :]
    for fields in _read_wordnet(wordnet / "data.noun"):
        pointers = 5 + 2 * int(fields[3], 16)
        links = zip(fields[pointers::4], fields[pointers + 1 :: 4], strict=False)
        kinds[fields[0]] = int(fields[1])
        above[fields[0]] = [synset for link, synset in links if link in ("@", "@i")]
        for synset in (fields[0], *above[fields[0]]):
            named[synset] += [
                w for one in fields[4 : pointers - 1 : 2] if (w := one.lower()) in rank
            ]
    lexicon = Lexicon(vectors, rank, senses, kinds, above, named)
    lexicon.adopt_names()
    return lexicon


def _read_wordnet(path: Path) -> Iterator[list[str]]:
    for line in path.read_text("latin-1").splitlines():
        if not line.startswith("  "):  # the licence
            yield line.partition(" | ")[0].split()


def list_words(lexicon: Lexicon, *, counted: Collection[str]) -> dict[str, bool]:
    """Return the words of a table → whether they are things: the most frequent first.

    Words that are no things are those that stand before the head of a compound in WordNet, or of a
    counted word.
    """
    ranked = sorted(lexicon.rank, key=lexicon.rank.__getitem__)

    def is_word(word: str) -> bool:
        return _WORD.fullmatch(word) is not None and split_head(word)[1] == word

    def is_thing(word: str, place: int) -> bool:
        share = 1.0 if lexicon.is_adopted(word) else lexicon.physical_share(word)
        return share >= _LEAST_PHYSICAL and place >= _FUNCTION_WORDS

    heads = {split_head(name)[1] for name in counted}
    things = [
        word
        for place, word in enumerate(ranked)
        if is_word(word) and lexicon.physical(word) and (word in heads or is_thing(word, place))
    ]
    compounds = [name for name in (*lexicon.senses, *counted) if " " in name]
    before = {
        w
        for name in compounds
        if lexicon.physical(name) or name in counted
        for w in name.split()[:-1]
    }
    must = [word for word in things[SIZE:] if word in heads]
    found = dict.fromkeys([*things[: SIZE - len(must)], *must], True)
    left = before - found.keys()
    other = [word for word in ranked if word in left and is_word(word)]
    return found | dict.fromkeys(other[:_MOST_OTHER], False)
