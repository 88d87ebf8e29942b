"""Say what a robot's words mean, by the models that may answer for them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property, partial

from bsg_data.errors import RecipeError
from bsg_data.scene.class_map import (
    DEFAULT_CLASS_MAP,
    ClassMap,
    list_class_maps,
    load_class_map,
)
from bsg_data.scene.uses import find_use, move_thing
from bsg_models.robot.nouns import NounTable, may_be_one, read_nouns
from bsg_models.robot.words import (
    Asked,
    Meaning,
    counts,
    explain_everyday,
    find_everyday,
    find_meaning,
    find_wider,
    list_owners,
    require_word,
    tell_apart,
)
from bsg_models.runs.found_model import DEFAULT_MODEL, WIDE_MAP, WIDE_MODEL, shipped_names
from bsg_models.runs.predictor import Predictor

THINGS = "things-v1"  # the table of everyday things, where it answers
_MODELS = {Asked.WIDE: (WIDE_MODEL, WIDE_MAP), Asked.DEFAULT: (DEFAULT_MODEL, DEFAULT_CLASS_MAP)}
_MOST = 1000  # words that are remembered


class Dictionary:
    """What words mean for a building that has a model of its own.

    Attributes:
        own: the building's model.
    """

    def __init__(self, own: Predictor) -> None:
        """Start without words."""
        self.own = own
        self._models = {Asked.OWN: own}
        self._meanings: dict[str, Meaning | None] = {}

    def model(self, asked: Asked) -> Predictor:
        """Return a model, loaded once."""
        if asked not in self._models:
            self._models[asked] = Predictor(_MODELS[asked][0])
        return self._models[asked]

    def class_map(self, asked: Asked) -> ClassMap:
        """Return the class map from a robot's words to the classes of a model."""
        return self.own.class_map if asked == Asked.OWN else load_class_map(_MODELS[asked][1])

    @cached_property
    def judge(self) -> Asked:
        """The model by whose classes nouns are judged."""
        return Asked.OWN if self.own.class_space == load_class_map().space else Asked.DEFAULT

    def answerer(self, meaning: Meaning) -> str:
        """Return the name of the model that answers for a meaning, or of the table of things."""
        if meaning.thing is not None:
            return THINGS
        asked = self.judge if meaning.class_index is None else meaning.model
        return self.own.name if asked == Asked.OWN else _MODELS[asked][0]

    def understand(self, word: str) -> Meaning:
        """Return what a word means; `RecipeError` if it means no thing."""
        require_word(word)
        found = self._meanings.get(word)
        if found is None:
            found = self._find(word)
            if found.class_name in self.model(found.model).untaught:
                never = f"no training building had a {found.class_name}, so none is expected"
                found = replace(found, how="; ".join(filter(None, (found.how, never))))
            self._remember(word, found)
        return found

    def look_up(self, word: str) -> Meaning | None:
        """Return what a word means; None if it means no thing."""
        if word not in self._meanings:
            try:
                return self.understand(word)
            except RecipeError:  # which takes long, to say what may have been meant
                self._remember(word, None)
        return self._meanings.get(word)

    def _remember(self, word: str, meaning: Meaning | None) -> None:
        if len(self._meanings) >= _MOST:
            self._meanings.clear()
        self._meanings[word] = meaning

    @cached_property
    def _nouns(self) -> NounTable | None:
        """No help for a model that everybody may use, because it is for research."""
        return None if self.own.is_free else read_nouns()

    def _find(self, word: str) -> Meaning:
        """Return what a word means; the table of everyday things knows more than likenesses do."""
        is_own = self.own.class_map.version not in list_class_maps()
        if is_own and self.own.class_map.lookup(word):
            return self._read(word, prefer_exact=False)
        read = partial(self._read, prefer_exact=not is_own)
        listed = find_everyday(word)
        thing, more = (listed, ()) if listed else find_wider(word)
        if thing is None:
            return read(word)
        others = [one for one in more if one not in list_owners(word)]
        uses = [one for one in others if find_use(one)]
        for name in () if uses else self.own.class_map.classes:
            if counts(name, thing):
                how = explain_everyday(thing, word, class_name=name)
                return replace(read(name), word=word, how=how)
        try:
            found = read(thing.name)
        except RecipeError:
            found = Meaning(word, None, None, Asked.OWN, "", is_exact=False)
        thing, told, nouns = move_thing(thing, uses), tell_apart(word), self._nouns
        how = explain_everyday(thing, word)
        is_kind = nouns is not None and nouns.knows(others)  # else a brand
        kind = frozenset(others if is_kind else uses)
        return replace(found, word=word, thing=thing, how=how, told=told, kind=kind)

    def _read(self, word: str, *, prefer_exact: bool) -> Meaning:
        maps = self._list_class_maps()
        return find_meaning(word, maps, prefer_exact=prefer_exact, nouns=self._nouns)

    def _list_class_maps(self) -> Iterator[ClassMap]:
        """Yield the model's class map, then that of the wide model if it may answer, too.

        It has to have another class space. A model that everybody may use is not helped by one
        with terms of its own.
        """
        own = self.own.class_map
        yield own
        wide = self.class_map(Asked.WIDE)
        has_wide = WIDE_MODEL in shipped_names() and own.space != wide.space
        if has_wide and not self.own.is_free:
            yield wide

    def names(self, meaning: Meaning) -> Callable[[str], bool]:
        """Return whether a robot's word for an object names a thing of this meaning."""
        noun, thing = meaning.noun, meaning.thing
        if thing is not None:

            def is_thing(word: str) -> bool:
                things = find_everyday(word), find_wider(word)[0]
                is_listed = any(one is not None and one.name == thing.name for one in things)
                is_named = is_listed or bool(noun and noun.names(word))
                told = tell_apart(word)
                return is_named and meaning.kind <= told and may_be_one(meaning.told, told)

            return is_thing
        if noun is not None:
            return noun.names
        class_map = self.model(meaning.model).class_map

        def is_of_class(word: str) -> bool:
            known = class_map.classify(word)
            if known.role != "unmapped":
                return known.class_index == meaning.class_index
            thing = find_everyday(word)
            return thing is not None and thing.wider == meaning.class_name

        return is_of_class
