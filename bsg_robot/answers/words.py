"""Find what a person's words mean: the class that answers for a thing, and rooms by id or label."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cache, lru_cache
from itertools import chain
from types import MappingProxyType

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.room_label import owner_of, read_room
from bsg_data.scene.synonyms import read_real_words
from bsg_data.words.nearest import Spellings, ask_if_meant
from bsg_data.words.normal import LONGEST, MARKS, list_parts, normalise_name, singulars
from bsg_data.words.shown import SHOWN, show_value
from bsg_models.belief.hidden_share import ShareBelief
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.runs.found_model import WIDE_MAP
from bsg_robot.answers.nouns import Noun, looks_of, split_head
from bsg_robot.graph.reports import follow_rooms
from bsg_robot.tables.table import read_table
from bsg_robot.things.things import Thing, find_keeping, find_thing, list_things
from bsg_robot.things.uses import find_use

_NO_THINGS = "not-things-v1.csv"
_OFFERED = 3  # nouns offered in an error
_REMEMBERED = 2**16  # words, as many as the largest map has: fewer would all be forgotten in turn
_MOST_BEFORE = 5  # words before the last one of a listed thing, and more
_LISTED = 8  # rooms listed in an error
_LABELS = 3  # kinds of rooms in a note
# `chair, garden` and `chair (garden)`
_KIND_BEHIND = re.compile(r"(?P<thing>[^\W\d][^,(\[/|]*?)\s*[,(\[]\s*(?P<kind>[\w'’ -]+)")
_NONE: Mapping[str, float] = MappingProxyType({})


class Asked(IntEnum):
    """The models that may answer for a word."""

    OWN = 0  # the building's
    DEFAULT = 1  # by whose classes nouns are judged, where the building's model has others


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a word is taken for: a class, or a noun that no model counts.

    Attributes:
        word: as it was asked.
        class_name: None if the building's model has no class for it.
        class_index: in its class space; None without a class.
        how: why, in words; empty if the word is the name of the class.
        is_exact: whether the class holds only such things; False for a teapot in `tableware`.
        noun: what the word means, if it is known and no class holds only such things.
        is_mended: whether the word is taken for another one, spelled almost like it.
        thing: the row of the table of everyday things, for one that no class holds alone.
        kind: words that make it a kind of the things of this row: `running` of running shoes.
        told: these, and what else tells it from other such things: `red` of a mug, a brand.
    """

    word: str
    class_name: str | None
    class_index: int | None
    how: str
    is_exact: bool
    noun: Noun | None = None
    is_mended: bool = False
    thing: Thing | None = None
    kind: frozenset[str] = frozenset()
    told: frozenset[str] = frozenset()

    @property
    def said(self) -> str:
        """The name without its place and marks."""
        return name_only(self.word)

    @property
    def owner(self) -> str | None:
        """Whose it is, by its name: it tells the thing from others, and is no kind of it."""
        return owner_of(self.word)

    @property
    def kept_as(self) -> str:
        """The first of its names of which it is known on which furniture such things are."""
        alike = self.is_exact or self.is_mended
        names = (self.said, self.thing.name if self.thing else "", self.class_name if alike else "")
        return next((name for name in names if name and find_keeping(name) is not None), self.said)

    @property
    def is_class(self) -> bool:
        """Whether a class answers alone."""
        return self.class_name is not None and self.noun is None and self.thing is None

    @property
    def name(self) -> str:
        """The class, or the word where more than the class answers."""
        return str(self.class_name) if self.is_class else " ".join(self.word.split())


@lru_cache(maxsize=_REMEMBERED)
def name_only(word: str) -> str:
    """Return the name of a thing without its place and marks: a book on the table is a book.

    A list has the thing first: a `chair, garden` is a garden chair.
    """
    bare, parts = word.strip(MARKS), list_parts(word)
    if bare in parts or len(word) > LONGEST or _is_listed(bare):
        return bare
    if found := _KIND_BEHIND.fullmatch(bare):
        thing, kind = found["thing"], found["kind"].strip(MARKS)
        turned, straight = f"{kind} {thing}", f"{thing} {kind}"
        is_use = any(find_use(word, by_thing=False) for word in kind.split())
        if list_parts(straight) == (straight,) and (is_use or _is_listed(turned)):
            return turned
    counted = (part for part in parts if load_class_map().classify(part).class_index is not None)
    listed = (part for known in (find_thing, _is_listed) for part in parts if known(part))
    return next(chain(counted, listed), parts[0])


def _is_listed(name: str) -> bool:
    return find_thing(name) is not None or load_class_map().lists(name)


def is_room(name: str) -> bool:
    """Say whether a word is listed as a kind of room; dinner is none, by a rule or not."""
    read = read_room(name)
    return read.label is not None and read.rule is None


@cache
def _read_kinds() -> Mapping[str, str]:
    """Return what words are that name no thing."""
    return dict(zip(*read_table(_NO_THINGS).values(), strict=True))


def find_kind(name: str) -> str | None:
    """Return what a word is that names no thing: a person, an animal, a colour, an event.

    An old man is a person, but a fire blanket is no event.
    """
    if len(name) > LONGEST:
        return None
    before, head = split_head(name)
    kinds = (_read_kinds().get(form) for form in (head, *singulars(head)))
    kind = next(filter(None, kinds), None)
    return kind if kind == "person" or not before else None


@lru_cache(maxsize=_REMEMBERED)  # the objects of a map are asked again and again
def find_everyday(word: str) -> Thing | None:
    """Return the everyday thing that a word names, whatever the thing looks like.

    A word that the table lacks is read by the rules of the default class map: `CoffeeTable`; then
    one typo is mended.
    """
    return None if len(word) > LONGEST else _find_listed(word) or _find_mended(word)


def _find_listed(word: str) -> Thing | None:
    """Return the thing that a name is listed as."""
    plain = name_only(word)
    before, head = split_head(plain)
    if thing := find_thing(plain) or find_thing(" ".join([*before, head])):
        return thing
    known = load_class_map().classify(plain)
    # Other names may be read as a wider thing: a mattress is a bed to the class map.
    is_renamed = known.role == "left-out" or known.rule not in (None, "head noun", "spelling")
    return find_thing(str(known.category)) if is_renamed else None


def _find_mended(word: str) -> Thing | None:
    plain = name_only(word)
    known = load_class_map().classify(plain)
    if known.rule == "spelling" and (thing := find_thing(str(known.category))):
        return thing
    if known.rule != "spelling" and known.role != "unmapped":
        return None
    near = sorted(_read_spellings().mend(normalise_name(plain), real=read_real_words()))
    return next(filter(None, map(find_thing, near)), None)


@lru_cache(maxsize=_REMEMBERED)
def find_wider(word: str) -> tuple[Thing | None, tuple[str, ...]]:
    """Return the everyday thing of which a name without a row says more, and what it says more.

    The longest listed end of the name is the thing: a Miele vacuum cleaner is a vacuum cleaner.
    None for a name that is listed, or that a class map knows as a whole; but for a known class of
    such things, as of chairs, if a word says in which rooms: a dining chair is a chair.

    >>> [(thing.name, told) for thing, told in [find_wider("my Nokia phone")] if thing]
    [('phone', ('nokia',))]
    """
    if len(word) > LONGEST or find_everyday(word):
        return None, ()
    plain, class_map = name_only(word), load_class_map()
    known = class_map.classify(plain)
    is_known = known.role != "unmapped" and known.rule != "head noun"
    before, head = split_head(str(known.category) if is_known and known.rule else plain)
    for number in range(max(1, len(before) - _MOST_BEFORE), len(before) + 1):
        name, more = " ".join([*before[number:], head]), tuple(before[:number])
        if thing := _find_listed(name):
            index = known.class_index
            is_kind = index is not None and index == class_map.classify(name).class_index
            if is_known and not (is_kind and any(map(find_use, more))):
                break
            return thing, more
    if known.role == "left-out":  # of no class of ours, but perhaps of one of the 170
        wide = load_class_map(WIDE_MAP)
        index = wide.classify(plain).class_index
        return (None, ()) if index is None else (find_thing(wide.classes[index]), tuple(before))
    return None, ()


@lru_cache(maxsize=_REMEMBERED)
def tell_apart(word: str) -> frozenset[str]:
    """Return the words that tell a thing from others of its row: how it looks, its brand or kind.

    >>> [sorted(tell_apart(word)) for word in ("red mug", "my Nokia phone", "wine glass")]
    [['red'], ['nokia'], []]
    """
    return looks_of(name_only(word)) | frozenset(find_wider(word)[1])


@cache
def _read_spellings() -> Spellings:
    """Return the words of everyday things."""
    return Spellings(name for thing in list_things() for name in thing.names)


def explain_everyday(thing: Thing, word: str, *, class_name: str | None = None) -> str:
    """Say where people search for an everyday thing, or which class counts it."""
    name, how = class_name or thing.name, []
    if normalise_name(word) != normalise_name(name):
        is_mended = _find_listed(word) is None and find_wider(word)[0] is None
        taken = f"no model knows {word!r}; taken for {name!r}, the most similar name"
        how.append(taken if is_mended else f"{word!r} is {name!r}")
    if class_name is None:
        rooms = ", ".join(label for label, _ in thing.rooms[:_LABELS])
        how.append(f"people search for it in: {rooms} (table of everyday things)")
    return "; ".join(how)


def require_word(word: object) -> None:
    """Refuse what cannot be the name of a thing."""
    if not isinstance(word, str) or not word.strip() or len(word) > LONGEST:
        raise RecipeError(
            f"expected the name of a thing, of 1 to {LONGEST} characters, found {show_value(word)}",
            code="thing-none",
        )


def find_room(graph: PartialGraph, name: str) -> int:
    """Return the index, 1..R, of the room with this id, or with a label that it alone has."""
    ids = [room.name for room in graph.rooms]
    if name in ids:
        return ids.index(name) + 1
    normal = normalise_name(str(name))
    labelled = [
        number
        for number, room in enumerate(graph.rooms, 1)
        if normal and normal in (normalise_name(room.label or ""), normalise_name(room.name))
    ]
    if len(labelled) == 1:
        return labelled[0]
    if labelled:
        those = ", ".join(ids[number - 1] for number in labelled[:_LISTED])
        raise RecipeError(
            f"{graph.scene_id}: {len(labelled)} rooms are called {name!r}; give the id of one: "
            f"{those}",
            code="room-ambiguous",
            where=name,
        )
    names = ids + [room.label for room in graph.rooms if room.label]
    hint = ask_if_meant(normal, names) or f"rooms are {', '.join(ids[:_LISTED]) or 'none'}"
    raise RecipeError(
        f"{graph.scene_id}: no room {str(name)[:SHOWN]!r}; {hint}", code="room-unknown", where=name
    )


def set_hidden_shares(
    graph: PartialGraph, *, every: float | None = None, rooms: Mapping[str, float] = _NONE
) -> PartialGraph:
    """Return a graph with the given hidden shares; the building's share follows from its rooms'.

    A share of 1 marks the room as not entered, and 0 as searched. In between, the visits stay as
    the graph has them.

    Args:
        graph: with shares of its own.
        every: share of all rooms that `rooms` does not name; of the building, if it has no rooms.
        rooms: shares by room id or label.

    Raises:
        RecipeError: if a share is not 0 to 1, or a name means no room or several.
    """
    if every is not None and not graph.rooms:
        return replace(graph, hidden_share=ShareBelief(every).mean)
    shares = {} if every is None else dict.fromkeys(range(1, len(graph.rooms) + 1), every)
    shares |= {find_room(graph, name): share for name, share in rooms.items()}
    known = list(graph.rooms)
    for index, given in shares.items():
        share, room = ShareBelief(given).mean, known[index - 1]
        visited = share < 1 and (share == 0 or room.visited)
        known[index - 1] = replace(room, hidden_share=share, hidden_share_sd=0.0, visited=visited)
    return follow_rooms(graph, replace(graph, rooms=tuple(known)))
