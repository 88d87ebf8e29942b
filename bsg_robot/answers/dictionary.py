"""Say what a robot's words mean, by the models that may answer for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any
from weakref import WeakKeyDictionary

from bsg_data.inputs.bounds import MAX_ROBOT_SOUGHT
from bsg_data.scene.class_map import ClassMap, load_class_map, published_maps
from bsg_data.scene.room_label import owner_of
from bsg_data.words.normal import LONGEST
from bsg_models.runs.found_model import DEFAULT_MODEL
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.nouns import NounTable, may_be_one, read_nouns
from bsg_robot.answers.words import (
    Asked,
    Meaning,
    counts,
    explain_everyday,
    find_everyday,
    find_known,
    find_meaning,
    find_wider,
    require_word,
    tell_apart,
)
from bsg_robot.things.things import Thing, find_group, find_thing
from bsg_robot.things.uses import find_use, move_thing

THINGS = "things-v1"  # the table of everyday things, where it answers
_STAYS = 48.0  # hours, of a thing that no table has
_MOST = 10_000  # words that are remembered, of each model
_MOST_NAMED = 1000  # the same, of each thing
_MEANINGS: WeakKeyDictionary[Predictor, dict[str, Meaning | None]] = WeakKeyDictionary()


class Dictionary:
    """What words mean for a building that has a model of its own.

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
        # Only who asks is told what may have been meant: that takes long.
        return find_meaning(word, **self._reading) if found is None else found

    def look_up(self, word: str) -> Meaning | None:
        """Return what a word means; None if it means no thing."""
        try:
            return self._meanings[word]  # which another thread may clear
        except KeyError:
            pass
        found = self._find(word) if word.strip() and len(word) <= LONGEST else None
        if found and found.is_class and found.class_name in self.own.untaught:
            never = f"no training building had a {found.class_name}, so the model expects none"
            found = replace(found, how="; ".join(filter(None, (found.how, never))))
        self._remember(word, found)
        return found

    def _remember(self, word: str, meaning: Meaning | None) -> None:
        if len(self._meanings) >= _MOST:
            self._meanings.clear()
        self._meanings[word] = meaning

    @cached_property
    def _nouns(self) -> NounTable | None:
        """No help for a model that everybody may use, because it is for research."""
        return None if self.own.is_free else read_nouns()

    @cached_property
    def _reading(self) -> dict[str, Any]:
        """How words are read: see `find_known`."""
        own = self.own.class_map
        is_own = own.version not in published_maps()
        return {"class_map": own, "prefer_exact": not is_own, "nouns": self._nouns}

    def _find(self, word: str) -> Meaning | None:
        """Return what a word means; the table of everyday things knows more than likenesses do."""
        own, is_own = self.own.class_map, not self._reading["prefer_exact"]
        if is_own and own.lookup(word):
            return find_known(word, **self._reading)
        listed = find_everyday(word)
        thing, more = (listed, ()) if listed else find_wider(word)
        if thing is None:
            return find_known(word, **self._reading)
        owner = owner_of(word)
        others = [one for one in more if one != owner]
        uses = [one for one in others if find_use(one)]
        # Of the wide classes, which few annotators noted, the table knows more.
        taught = {*(own.classes if is_own else load_class_map().classes)} - {*self.own.untaught}
        for name in () if uses else own.classes:
            if counts(name, thing) and name in taught:
                how = explain_everyday(thing, word, class_name=name)
                return replace(find_meaning(name, **self._reading), word=word, how=how)
        known = find_known(thing.name, **self._reading)
        found = known or Meaning(word, None, None, "", is_exact=False)
        thing, told, nouns = move_thing(thing, uses), tell_apart(word), self._nouns
        how = explain_everyday(thing, word)
        is_kind = nouns is not None and nouns.knows(others)  # else a brand
        kind = frozenset(others if is_kind else uses)
        return replace(found, word=word, thing=thing, how=how, told=told, kind=kind)

    def thing_of(self, meaning: Meaning) -> Thing | None:
        """Return the row of the table of things for a meaning."""
        return meaning.thing or find_thing(meaning.class_name or "")

    def stays(self, meaning: Meaning | None) -> float:
        """Return the hours after which half of such things are elsewhere."""
        thing = None if meaning is None else self.thing_of(meaning)
        return _STAYS if thing is None else thing.stays

    def staying(self, said: float | None) -> Callable[[str], float]:
        """Return word → hours after which half of such things are elsewhere, or as is said."""
        return lambda word: said or self.stays(self.look_up(word))

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
                things = find_everyday(word), find_wider(word)[0]
                is_listed = any({one.name, one.wider} & {*thing.names} for one in things if one)
                if not is_listed and not (noun and noun.names(word)):
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
