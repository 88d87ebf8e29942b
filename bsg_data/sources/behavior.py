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
from itertools import chain
from pathlib import Path
from typing import Annotated

from pydantic import Field

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import SourceError
from bsg_data.inputs.documents import read_json
from bsg_data.records import ForeignRecord, Keyed
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import SceneName, once_for_each_state, validate
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


_Name = Annotated[str, Field(max_length=200)]  # the longest real one has 38 characters
_Count = Annotated[int, Field(ge=0, le=_MAX_OBJECTS)]
_RoomLists = Mapping[str, Mapping[str, int]]  # room → `category-model` → how many
_Floors = dict[int, dict[str, _RoomLists]]  # floor → scene → its rooms


class _Listing(ForeignRecord, strict=True):
    scenes: Annotated[Keyed[SceneName, Keyed[str, Keyed[_Name, _Count]]], Field(min_length=1)]


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
        houses = _read_houses(self.path, self.as_listed)
        refs = [
            SceneRef(name, ", ".join(chain.from_iterable(floors.values())), _digest(_join(floors)))
            for name, floors in houses.items()
        ]
        each = chain.from_iterable(floors.values() for floors in houses.values())
        return FoundScenes(tuple(refs), duplicates=tuple(chain(*map(_find_doubles, each))))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one building; the regions are its rooms, floor by floor, in the order of names."""
        floors = _join(_read_houses(self.path, self.as_listed)[ref.scene_id])
        rooms: list[AnnotatedRoom] = []
        objects: list[tuple[int, str]] = []
        for number, listed in floors.items():
            for name, content in sorted(listed.items(), key=lambda room: _split_room(room[0])):
                held = _list_objects(content, f"{self.path}: {ref.location}, {name}")
                objects += ((len(rooms), category) for category in held)
                word, _ = _split_room(name)
                rooms.append(
                    AnnotatedRoom(region=len(rooms), source_label=word, floor_index=number)
                )
        annotation = Annotation(
            [region for region, _ in objects],
            [category for _, category in objects],
            rooms=rooms,
            building_kind=_find_building_kind(ref.scene_id),
        )
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))


@once_for_each_state
def _read_houses(path: Path, as_listed: bool) -> dict[str, _Floors]:
    """Read the list: building → floor → scene → its rooms, the scene with the garden first."""
    expected = f"scenes → room → category-model → number, as in {_FILE} of the package bddl"
    document, code = read_json(path), "listing-malformed"
    scenes = validate(_Listing, document, where=path, expected=expected, code=code).scenes
    houses: dict[str, _Floors] = {}
    for scene in sorted(scenes):  # `garden` stands before `int`
        building, floor = (scene, 0) if as_listed else _find_floor(scene)
        houses.setdefault(building, {}).setdefault(floor, {})[scene] = scenes[scene]
    return {name: dict(sorted(houses[name].items())) for name in sorted(houses)}


def _join(floors: _Floors) -> dict[int, _RoomLists]:
    """Return the rooms of each floor, each as the first of its scenes has it."""
    return {
        number: {
            name: content for rooms in reversed(scenes.values()) for name, content in rooms.items()
        }
        for number, scenes in floors.items()
    }


def _find_doubles(scenes: Mapping[str, _RoomLists]) -> Iterator[SkippedScene]:
    first, *others = scenes
    for scene in others:
        if set(scenes[scene]) <= set(scenes[first]):
            yield SkippedScene(scene, scene, f"{first} has all its rooms, and the garden")


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
