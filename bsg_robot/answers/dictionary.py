"""Say what a robot's words mean, by the models that may answer for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import islice
from weakref import WeakKeyDictionary

from bsg_data.errors import RecipeError
from bsg_data.inputs.bounds import MAX_ROBOT_SOUGHT
from bsg_data.scene.class_map import ClassMap, load_class_map, published_maps
from bsg_data.scene.room_label import owner_of
from bsg_data.words.nearest import SHORT, is_typo, nearest_names
from bsg_data.words.normal import LONGEST, normalise_name, singulars
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.nouns import NounTable, may_be_one, read_nouns, split_head
from bsg_robot.answers.words import (
    Asked,
    Meaning,
    explain_everyday,
    find_everyday,
    find_kind,
    find_wider,
    is_room,
    name_only,
    require_word,
    tell_apart,
)
from bsg_robot.things.things import Thing, find_group, find_thing, list_things
from bsg_robot.things.uses import find_use, move_thing

THINGS = "things-v1"  # the table of everyday things, where it answers
_STAYS = 48.0  # hours, of a thing that no table has
_MOST = 10_000  # words that are remembered, of each model
_MOST_NAMED = 1000  # the same, of each thing
_OFFERED = 3  # nouns offered in an error
_REASONS = {  # why no model looks for a word, by what the class map reads
    "structure": "it is a part of the building, and models count objects",
    "left-out": "class maps know the name, but no shipped model has a class for it",
}
_MEANINGS: WeakKeyDictionary[Predictor, dict[str, Meaning | None]] = WeakKeyDictionary()


class Dictionary:
    """What words mean for a building that has a model of its own.

    The first rule that knows a word counts:

    1. a class that counts just the things of its row in the table of everyday things;
    2. the row itself, which knows more than likenesses do, but not of a word that the user's own
       class map lists;
    3. a class, however wide; what the word means narrows it, but in the user's own class map;
    4. a noun, which no model counts.

    Attributes:
        own: the building's model.
    """

    def __init__(self, own: Predictor) -> None:
        """Start with the words that this model was asked for."""
        self.own = own
        self._models = {Asked.OWN: own}
        self._names: dict[str, Callable[[str], bool]] = {}
        self._meanings = _MEANINGS.setdefault(own, {})

    def model(self, asked: Asked) -> Predictor:
        """Return a model, loaded once."""
        if asked not in self._models:
            self._models[asked] = Predictor(DEFAULT_MODEL)
        return self._models[asked]

    def class_map(self, asked: Asked) -> ClassMap:
        """Return the class map from a robot's words to the classes of a model."""
        return self.own.class_map if asked == Asked.OWN else load_class_map()

    @cached_property
    def judge(self) -> Asked:
        """The model by whose classes nouns are judged."""
        return Asked.OWN if self.own.class_space == load_class_map().space else Asked.DEFAULT

    def answerer(self, meaning: Meaning) -> str:
        """Return the name of the model that answers for a meaning, or of the table of things."""
        if meaning.thing is not None:
            return THINGS
        if meaning.class_index is not None or self.judge == Asked.OWN:
            return self.own.name
        return DEFAULT_MODEL

    def understand(self, word: str) -> Meaning:
        """Return what a word means; `RecipeError` if it means no thing."""
        require_word(word)
        found = self.look_up(word)
        if found is None:
            raise self._refuse(word)
        return found

    def look_up(self, word: str) -> Meaning | None:
        """Return what a word means; None if it means no thing."""
        try:
            return self._meanings[word]  # which another thread may clear
        except KeyError:
            pass
        found = None
        if word.strip() and len(word) <= LONGEST:
            found = self._find_counted(word) or self._find_row(word) or self._find_by_class(word)
        if found and found.is_class and found.class_name in self.own.untaught:
            never = f"no training building had a {found.class_name}, so the model expects none"
            found = replace(found, how="; ".join(filter(None, (found.how, never))))
        if len(self._meanings) >= _MOST:
            self._meanings.clear()
        self._meanings[word] = found
        return found

    def _find_by_class(self, word: str) -> Meaning | None:
        """Return what a word means without the table of things."""
        return self._find_class(word) or self._find_noun(word)

    @cached_property
    def _has_own_map(self) -> bool:
        return self.own.class_map.version not in published_maps()

    def _row_of(self, word: str) -> tuple[Thing | None, tuple[str, ...]]:
        """Return the row of the table of things that a word is of, and the words that say more."""
        if self._has_own_map and self.own.class_map.lookup(word):
            return None, ()
        listed = find_everyday(word)
        return (listed, ()) if listed else find_wider(word)

    def _find_counted(self, word: str) -> Meaning | None:
        thing, more = self._row_of(word)
        if thing is None or any(find_use(epithet) for epithet in more if epithet != owner_of(word)):
            return None
        classes = self.own.class_map.classes
        # Of the wide classes, which few annotators noted, the table knows more.
        taught = {*(classes if self._has_own_map else load_class_map().classes)}
        taught -= {*self.own.untaught}
        name = next((name for name in classes if name in thing.names and name in taught), None)
        found = None if name is None else self._find_by_class(name)
        return found and replace(
            found, word=word, how=explain_everyday(thing, word, class_name=name)
        )

    def _find_row(self, word: str) -> Meaning | None:
        thing, more = self._row_of(word)
        if thing is None:
            return None
        found = self._find_by_class(thing.name) or Meaning(word, None, None, "", is_exact=False)
        others = [epithet for epithet in more if epithet != owner_of(word)]
        uses = [epithet for epithet in others if find_use(epithet)]
        is_kind = self._nouns is not None and self._nouns.knows(others)  # else a brand
        thing = move_thing(thing, uses)
        return replace(
            found,
            word=word,
            thing=thing,
            how=explain_everyday(thing, word),
            told=tell_apart(word),
            kind=frozenset(others if is_kind else uses),
        )

    def _find_class(self, word: str) -> Meaning | None:
        """Return the class of a word; one that holds other things, too, is narrowed by its noun."""
        found = self._classify(word)
        if found is None or found.is_exact or found.is_mended or self._has_own_map:
            return found
        noun = self._nouns.find(name_only(word)) if self._nouns else None
        if noun is None or found.class_name in noun.like:  # a sofa is a couch
            return found
        how = f"{found.how}, and judged by what is like it: {', '.join(noun.like)}"
        if more := split_head(noun.name)[0]:
            how += f"; {' '.join(more)!r} sets it apart from any other {noun.head}"
        return replace(found, how=how, noun=noun)

    def _find_noun(self, word: str) -> Meaning | None:
        """Return a noun that is no part of the building, room, person, colour or event."""
        plain = name_only(word)
        noun = self._nouns.find(plain) if self._nouns else None
        role = self.own.class_map.classify(plain).role
        if noun is None or role == "structure" or is_room(plain) or self._kind_of(plain):
            return None
        by_head = "" if split_head(noun.name) == ([], noun.head) else f"its word {noun.head!r} and "
        how = (
            f"no model counts {noun.name!r}, so it is judged by {by_head}what is like it: "
            f"{', '.join(noun.like)}"
        )
        return Meaning(word, None, None, how, is_exact=False, noun=noun)

    @cached_property
    def _nouns(self) -> NounTable | None:
        """No help for a model that everybody may use, because it is for research."""
        return None if self.own.is_free else read_nouns()

    def _kind_of(self, plain: str) -> str | None:
        """Return what a word is that names no thing, if the class map does not know it."""
        is_unknown = self.own.class_map.classify(plain).role in ("unmapped", "nameless")
        return find_kind(plain) if is_unknown else None

    def _classify(self, word: str) -> Meaning | None:
        """Return the class of a word by the map of the model; None if it has none."""
        class_map, thing = self.own.class_map, name_only(word)
        named, spoken = [*map(normalise_name, class_map.classes)], normalise_name(thing)
        if spoken in named:
            index = named.index(spoken)
            how = "" if thing == word else f"{word!r} is {thing!r}"
            return Meaning(word, class_map.classes[index], index, how, is_exact=True)
        found = class_map.classify(thing)
        if found.class_index is None:
            return None
        name, category = class_map.classes[found.class_index], str(found.category)
        is_mended = found.rule == "spelling"
        steps = []
        if is_mended:
            steps.append(f"no model knows {word!r}; taken for {category!r}, the most similar name")
        elif spoken != normalise_name(category):
            rule = "" if found.rule is None else f" by the rule {found.rule!r}"
            steps.append(f"{word!r} is {category!r}{rule}")
        if category != name:
            steps.append(f"{category!r} is one of the class {name!r}")
        is_exact = not is_mended and name in (category, *singulars(category))
        how = ", ".join(steps)
        return Meaning(word, name, found.class_index, how, is_exact, is_mended=is_mended)

    def _refuse(self, word: str) -> RecipeError:
        """Return the error for a word that means no thing; it says what may have been meant."""
        plain = name_only(word)
        role, kind = self.own.class_map.classify(plain).role, self._kind_of(plain)
        near = () if kind else self._near(plain)
        if kind is not None:
            article = "an" if kind[0] in "aeiou" else "a"
            why = f"it is the word for {article} {kind}, and models look for things"
        else:
            why = _REASONS.get(role, "no known thing has this English name")
        hint = f"; did you mean {', '.join(near)}?" if near else "."
        return RecipeError(
            f"no model here can look for {word!r}: {why}{hint} `bsg-data map show CATEGORY` says "
            "which class a name has",
            code="thing-unknown",
            where=word,
        )

    def _near(self, plain: str) -> tuple[str, ...]:
        """Return names of things and classes, or else of nouns, that are spelled alike."""
        class_map, word = self.own.class_map, normalise_name(plain)
        # Corrected names of the map, because published spellings have errors.
        counted = (
            one.category for one in class_map.entries.values() if one.class_index is not None
        )
        names = [name for thing in list_things() for name in thing.names]
        names += map(normalise_name, (*map(str, counted), *class_map.classes))
        if near := nearest_names(word, names):
            return near
        is_unmapped = class_map.classify(plain).role == "unmapped" and len(word) > SHORT
        nouns = self._nouns.known if self._nouns and is_unmapped else ()
        return tuple(islice((noun for noun in nouns if is_typo(word, noun)), _OFFERED))

    def thing_of(self, meaning: Meaning) -> Thing | None:
        """Return the row of the table of things for a meaning."""
        return meaning.thing or find_thing(meaning.class_name or "")

    def stays(self, meaning: Meaning | None) -> float:
        """Return the hours after which half of such things are elsewhere."""
        thing = None if meaning is None else self.thing_of(meaning)
        return _STAYS if thing is None else thing.stays

    def staying(self, hours: float | None) -> Callable[[str], float]:
        """Return word → hours after which half of such things are elsewhere, or the given ones."""
        return lambda word: hours or self.stays(self.look_up(word))

    def groups(self, meaning: Meaning | None) -> tuple[str, ...]:
        """Return the groups of things that a thing is of; none if no table says it."""
        thing = None if meaning is None else self.thing_of(meaning)
        return () if thing is None else thing.groups

    def is_of(self, group: str) -> Callable[[str], bool]:
        """Return whether a word names a group of things, or one of them."""
        return lambda word: group in (find_group(word), *self.groups(self.look_up(word)))

    def names(self, meaning: Meaning) -> Callable[[str], bool]:
        """Return whether a robot's word for an object names a thing of this meaning."""
        found = self._names.get(meaning.word)
        if found is None:
            if len(self._names) >= MAX_ROBOT_SOUGHT:
                self._names.clear()
            found = self._names[meaning.word] = lru_cache(_MOST_NAMED)(self._tell_names(meaning))
        return found

    def _tell_names(self, meaning: Meaning) -> Callable[[str], bool]:
        noun, thing = meaning.noun, meaning.thing
        if thing is not None:

            def is_thing(word: str) -> bool:
                known = _list_names(word)
                if known.isdisjoint(thing.names) and not (noun and noun.names(word)):
                    return False
                told = tell_apart(word)
                return meaning.kind <= told and may_be_one(meaning.told, told)

            return is_thing
        if noun is not None:
            return noun.names
        class_map = self.own.class_map

        def is_of_class(word: str) -> bool:
            if class_map.classify(word).class_index == meaning.class_index:
                return True
            thing = find_everyday(word)
            return thing is not None and thing.wider == meaning.class_name

        return is_of_class


@lru_cache(maxsize=4096)  # all that is sought is compared with all that was seen
def _list_names(word: str) -> frozenset[str | None]:
    """Return the names of the things that a word is read as, and of what they are kinds of."""
    things = find_everyday(word), find_wider(word)[0]
    return frozenset(name for row in things if row for name in (row.name, row.wider))
