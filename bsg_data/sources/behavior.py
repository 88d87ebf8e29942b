"""BEHAVIOR-1K's list of rooms and their objects: homes, offices, schools, restaurants, shops.

The package `bddl` holds `generated_data/combined_room_object_list.json`: `scenes` → room
(`kitchen_0`, its type and number) → `category-model` → how many. It says nothing of places.

A scene of BEHAVIOR is one floor of a house, with or without its garden. Here a building is the
whole house. Otherwise a model could train and be tested on the same rooms: `Rs_garden` has all
rooms of `Rs_int`.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import SourceError
from bsg_data.inputs.documents import read_json
from bsg_data.records import ForeignRecord, Keyed
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import is_scene_id
from bsg_data.sources.annotation_files import fetch_listed, state_of, validate
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    SourceRow,
)
from bsg_data.terms import Terms
from bsg_data.words.shown import show_value

_FILE = "combined_room_object_list.json"
_MAX_OBJECTS = 10**5  # of one model in a room; the largest real building has 7,020 in all
_FLOOR = re.compile(r"([A-Z][A-Za-z]*)(?:_([0-9]{1,3}))?_(?:int|garden)")
_STOREY = re.compile(r"(house_double_floor)_(lower|upper)")
_ROOM = re.compile(r"(.+)_([0-9]{1,6})")
# What the first words of a name say that the building is.
_KINDS = {
    **dict.fromkeys(("Beechwood", "Benevolence", "Ihlen", "Merom", "Pomaria"), "home"),
    **dict.fromkeys(("Rs", "Wainscott"), "home"),
    "gates_bedroom": "home",
    "grocery_store": "shop",
    "hall": "hall",
    "hotel": "hotel",
    "house": "home",
    "office": "office",
    "restaurant": "restaurant",
    "school": "school",
}

# BEHAVIOR has one category for two things. These models stand in public washrooms without a shower,
# one for each toilet: they are its cubicles. The others are showers.
_TOILET_STALLS = frozenset(
    f"shower_stall-{model}"
    for model in ("gqxmqf", "nvempw", "rhvubh", "sqzpmj", "taqzxq", "vshrva")
)


def _require_scene_id(name: str) -> str:
    if not is_scene_id(name):
        raise ValueError("cannot be the name of a scene")
    return name


_Scene = Annotated[str, AfterValidator(_require_scene_id)]
_Name = Annotated[str, Field(max_length=200)]  # the longest real one has 38 characters
_Count = Annotated[int, Field(ge=0, le=_MAX_OBJECTS)]
_RoomLists = Mapping[str, Mapping[str, int]]  # room → `category-model` → how many


class _Listing(ForeignRecord, strict=True):
    scenes: Annotated[Keyed[_Scene, Keyed[str, Keyed[_Name, _Count]]], Field(min_length=1)]


def _find_floor(scene: str) -> tuple[str, int]:
    """Return the house that a scene is a floor of, or its own name; and which, from below."""
    if match := _FLOOR.fullmatch(scene):
        return match[1], int(match[2] or 0)
    if match := _STOREY.fullmatch(scene):
        return match[1], ("lower", "upper").index(match[2])
    return scene, 0


def _find_building_kind(scene: str) -> str | None:
    """Return what the name of a scene says that it is; None for a name that is not BEHAVIOR's."""
    starts = (kind for start, kind in _KINDS.items() if f"{scene}_".startswith(f"{start}_"))
    return next(starts, None)


@dataclass(frozen=True)
class _BehaviorRooms:
    """BEHAVIOR-1K's list of rooms and their objects."""

    path: Path  # the JSON file
    # take every scene of the list for a building of its own, under its own name; a house is then
    # there several times, and can be in two splits
    as_listed: bool = False

    kind = "behavior"

    @property
    def options(self) -> dict[str, int | str]:
        """Whether floors and gardens stay apart."""
        return {"as_listed": int(self.as_listed)}

    def find(self) -> FoundScenes:
        """List the buildings, and the scenes whose rooms another scene has with the garden."""
        houses = self._houses()
        refs = tuple(
            SceneRef(
                scene_id=building,
                location=", ".join(scene for scenes in floors.values() for scene in scenes),
                fingerprint=_digest(self._floors(floors)),
            )
            for building, floors in houses.items()
        )
        return FoundScenes(refs, duplicates=tuple(self._find_doubles(houses)))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one building; the regions are its rooms, floor by floor, in the order of names."""
        floors = fetch_listed(
            ref, self.path, lambda: self._floors(self._houses()[ref.scene_id]), _digest
        )
        rooms: list[AnnotatedRoom] = []
        regions: list[int] = []
        names: list[str] = []
        for number, listed in floors.items():
            for name, content in sorted(listed.items(), key=lambda one: _split_room(one[0])):
                held = [*_list_objects(content, f"{self.path}: {ref.location}, {name}")]
                regions += [len(rooms)] * len(held)
                names += held
                word = _split_room(name)[0]
                rooms.append(
                    AnnotatedRoom(region=len(rooms), source_label=word, floor_index=number)
                )
        kind = _find_building_kind(ref.scene_id)
        annotation = Annotation(regions, names, rooms=rooms, building_kind=kind)
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))

    def _floors(self, floors: Mapping[int, list[str]]) -> dict[int, _RoomLists]:
        return {number: self._rooms(scenes) for number, scenes in floors.items()}

    def _houses(self) -> dict[str, dict[int, list[str]]]:
        return _group_scenes(self.path, *state_of(self.path), as_listed=self.as_listed)

    def _rooms(self, scenes: list[str]) -> _RoomLists:
        """Return the rooms of a floor, each as the first of its scenes has it."""
        rooms: dict[str, Mapping[str, int]] = {}
        for scene in reversed(scenes):
            rooms.update(self._scenes[scene])
        return rooms

    def _find_doubles(self, houses: dict[str, dict[int, list[str]]]) -> Iterator[SkippedScene]:
        for first, *others in (scenes for floors in houses.values() for scenes in floors.values()):
            for scene in others:
                if set(self._scenes[scene]) <= set(self._scenes[first]):
                    reason = f"{first} has all its rooms, and the garden"
                    yield SkippedScene(scene_id=scene, location=scene, reason=reason)

    @property
    def _scenes(self) -> Mapping[str, _RoomLists]:
        return _read_listing(self.path, *state_of(self.path))


@lru_cache(maxsize=2)
def _read_listing(path: Path, size: int, changed: int) -> Mapping[str, _RoomLists]:
    """Read the list, once for each state of the file."""
    expected = f"scenes → room → category-model → number, as in {_FILE} of the package bddl"
    document = read_json(path)
    code = "listing-malformed"
    return validate(_Listing, document, where=path, expected=expected, code=code).scenes


@lru_cache(maxsize=2)
def _group_scenes(
    path: Path, size: int, changed: int, *, as_listed: bool
) -> dict[str, dict[int, list[str]]]:
    """Return building → floor → its scenes, the one with the garden first."""
    houses: dict[str, dict[int, list[str]]] = {}
    for scene in sorted(_read_listing(path, size, changed)):  # `garden` stands before `int`
        building, floor = (scene, 0) if as_listed else _find_floor(scene)
        houses.setdefault(building, {}).setdefault(floor, []).append(scene)
    return {name: dict(sorted(houses[name].items())) for name in sorted(houses)}


def _list_objects(content: Mapping[str, int], where: str) -> Iterator[str]:
    """Yield the category of every object of a room, in the order of `category-model`.

    It is as listed but for cubicles of washrooms, which are `toilet_stall`.
    """
    for name, count in sorted(content.items()):
        category, _, model = name.rpartition("-")
        if not category or not model:
            raise SourceError(
                f"{where}: expected category-model, such as sofa-ahgkci; found {show_value(name)}",
                code="model-malformed",
                where=where,
            )
        for _ in range(count):
            yield "toilet_stall" if name in _TOILET_STALLS else category


def _split_room(room: str) -> tuple[str, int]:
    """Return the type of a room and its number; -1 without one."""
    match = _ROOM.fullmatch(room)
    return (match[1], int(match[2])) if match else (room, -1)


def _digest(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()  # noqa: TID251


ROW = SourceRow(
    summary="BEHAVIOR-1K's list of rooms and their objects, a JSON file of the package bddl",
    open=_BehaviorRooms,
    terms=Terms(
        licence="MIT",
        licence_url="https://opensource.org/license/mit",
        homepage="https://behavior.stanford.edu",
        citation=(
            "Li et al., BEHAVIOR-1K: A Human-Centered, Embodied AI Benchmark with 1,000 Everyday "
            "Activities and Realistic Simulation, 2024, arXiv:2403.09227"
        ),
        sentence=(
            "The list of rooms and objects is under the MIT licence of the package bddl, and is "
            "all that is read. The scenes and assets that it lists are under BEHAVIOR's own terms."
        ),
    ),
    class_map="behavior45-v1",
)
