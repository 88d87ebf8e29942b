"""ProcTHOR's houses: rooms with their floors, the doors between them, objects and their places.

A house is a JSON object; files hold one a line (`.jsonl`), or an array of them (`.json`), gzip or
not. `rooms` have `id` (`room|4`), `roomType` and `floorPolygon`; `doors` name two rooms; `objects`
have `id`, whose first number is the room's (`4|0|0`, `Apple|surface|4|0`), `assetId` (`Bed_25`),
`position`, and in `children` what is in or on them; `walls` say how high a room is. Metres, Y up,
left-handed.

Doors, windows and walls are no objects there, and so none here.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, BinaryIO, ClassVar

import numpy as np
from pydantic import Field, field_validator

from bsg_data.errors import SourceError
from bsg_data.geometry.placement import surround
from bsg_data.inputs.bounded_file import open_stream
from bsg_data.inputs.documents import require_json
from bsg_data.records import ForeignRecord, Listed, Position
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import measure_area
from bsg_data.sources.annotation_files import keep_one_copy, state_of, validate
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

_SUFFIXES = (".jsonl", ".jsonl.gz", ".json", ".json.gz")
_NUMBERED = 10**5  # a scene id has five digits for the number of the house in its file
_SPLITS = ("train", "val", "test")
_OF_ROOM = re.compile(r"(?:^|\|)([0-9]{1,6})(?:\||$)")  # 4|0|0, small|4|5, Apple|surface|4|0
_BETWEEN = re.compile(r"[\s,]*")  # what stands between two houses of an array
_DECODER = json.JSONDecoder()
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])")
_MOST_OPEN = 100  # files that stay open; ProcTHOR-10K has three
_Houses = Iterator[tuple[int, bytes]]  # number and text

_Name = Annotated[str, Field(min_length=1, max_length=200)]


class _Room(ForeignRecord):
    id: Annotated[str, Field(pattern=r"^room\|[0-9]{1,6}$")]
    room_type: Annotated[_Name, Field(alias="roomType")]
    corners: Annotated[Listed[Position], Field(alias="floorPolygon", min_length=3)]

    @property
    def number(self) -> int:
        return int(self.id.removeprefix("room|"))


class _Door(ForeignRecord):
    room0: str
    room1: str


class _Wall(ForeignRecord):
    room_id: Annotated[str | None, Field(alias="roomId")] = None
    polygon: Listed[Position] = ()


class _Thing(ForeignRecord):
    id: _Name
    asset: Annotated[_Name, Field(alias="assetId")]
    position: Position
    children: Listed[_Thing] = ()


def _unpack(things: Iterable[_Thing]) -> Iterator[_Thing]:
    """Yield things, each before its children."""
    for thing in things:
        yield thing
        yield from _unpack(thing.children)


class _House(ForeignRecord):
    rooms: Annotated[Listed[_Room], Field(min_length=1)]
    doors: Listed[_Door] = ()
    walls: Listed[_Wall] = ()
    objects: Listed[_Thing] = ()

    @field_validator("rooms")
    @classmethod
    def _are_there_once(cls, rooms: tuple[_Room, ...]) -> tuple[_Room, ...]:
        (twice, times), *_ = Counter(room.id for room in rooms).most_common(1)
        if times > 1:
            raise ValueError(f"{show_value(twice)} is there twice")
        return rooms


# process, thread, file and its state → the number of the house last read, and the houses after it:
# after a fork, two would move the place in one file
_open: dict[tuple[object, ...], tuple[int, _Houses]] = {}


@dataclass(frozen=True)
class _ProcTHORHouses:
    """A file of ProcTHOR's houses, or a folder with such files.

    A scene id is the number of the house in its file, from 0 as Python counts them, and a hash of
    its text: `00042-9f86d081884c`. The same house in two files is taken once.
    """

    path: Path

    kind = "procthor"
    options: ClassVar[dict[str, int | str]] = {}

    def find(self) -> FoundScenes:
        """Find the houses; of each only the hash is taken."""
        refs = [
            self._refer(file, index, *house)
            for file in self._files()
            for index, house in enumerate(_stream(file))
        ]
        expected = (
            "holds no house; expected a JSON object a line or an array, in files that end in "
            f"{', '.join(_SUFFIXES)}"
        )
        return keep_one_copy(refs, path=self.path, expected=expected)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one house."""
        name, _, number = ref.location.rpartition(":")
        file = self.path / name if self.path.is_dir() else self.path
        where = ref.location
        document, expected = require_json(_fetch(file, int(number)), where), "a house of ProcTHOR"
        house = validate(_House, document, where=where, expected=expected, code="house-malformed")
        things = [*_unpack(house.objects)]
        annotation = Annotation(
            _find_regions(things, house.rooms),
            [_name_asset(thing.asset) for thing in things],
            centroids=[_upright(thing.position) for thing in things],
            rooms=_describe_rooms(house),
            doors=_list_doors(house),
            method="door",
            building_kind="home",
        )
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))

    def _files(self) -> list[Path]:
        if not self.path.is_dir():
            return [self.path]
        return sorted(file for file in self.path.iterdir() if file.name.endswith(_SUFFIXES))

    def _refer(self, file: Path, index: int, number: int, text: bytes) -> SceneRef:
        digest = hashlib.sha256(text).hexdigest()
        name = f"{index:05d}-{digest[:12]}" if index < _NUMBERED else digest[:12]
        stem = file.name.split(".")[0]
        split = stem if stem in _SPLITS else None
        location, building = f"{file.name}:{number}", digest[:12]
        return SceneRef(name, location, digest, source_split=split, building=building)


def _name_asset(asset: str) -> str:
    """Return what kind of thing an asset is, by its name.

    The words before the first number tell it. `RoboTHOR` says where an asset is from, and a single
    letter which variant it is.

    >>> _name_asset("Dining_Table_208_2"), _name_asset("RoboTHOR_mug_ai2_1_v"), _name_asset("bin_4")
    ('dining table', 'mug ai', 'bin')
    >>> _name_asset("DecorativeBox2"), _name_asset("Countertop_L_10x8")
    ('decorative box', 'countertop')
    >>> _name_asset("CD_1"), _name_asset("0a1b2c3d4e5f")
    ('cd', '')
    """
    words = []
    for word in asset.removeprefix("RoboTHOR_").split("_"):
        if word[:1].isdigit():
            break
        words.append(_CAMEL.sub(" ", word.rstrip("0123456789")))
    return " ".join(word for word in words if len(word) > 1).casefold()


def _stream(file: Path) -> _Houses:
    """Yield the number, from 1, of the line or of the element, and the text of every house."""
    number = 0
    is_lines = ".jsonl" in file.name
    unit = "line" if is_lines else "house"

    def refuse(reason: str, **fault: Any) -> SourceError:
        after = f", after {unit} {number}" if number else ""
        return SourceError(f"{file}{after}{reason.removeprefix(str(file))}", **fault)

    with open_stream(file, error=refuse) as opened:
        texts = opened if is_lines else _split(opened)
        try:
            for number, text in enumerate(texts, start=1):
                if text.strip():
                    yield number, text.strip()
        except (ValueError, RecursionError) as error:
            raise refuse(f": expected JSON ({error})", code="json-malformed", where=file) from error


def _split(opened: BinaryIO) -> Iterator[bytes]:
    """Yield the houses of an array, or one house that has more than a line."""
    text = opened.read().decode("utf-8-sig").strip()
    is_array = text.startswith("[")
    at = int(is_array)
    while (at := _BETWEEN.match(text, at).end()) < len(text):  # type: ignore[union-attr]
        if is_array and text.startswith("]", at):
            break
        _, stop = _DECODER.raw_decode(text, at)
        yield text[at:stop].encode()
        at = stop
    if is_array and text[at:] != "]":
        after = "something stands after the array"
        raise ValueError(after if text[at:] else "the array has no end; the file was cut off")


def _fetch(file: Path, number: int) -> bytes:
    """Return the text of a house.

    A compressed file has no way to a line but from its beginning. Builds read the houses of
    several files in turns, those of a file in their order. So each thread goes on in each file
    where it was, and begins again only for an earlier house.
    """
    key = (os.getpid(), threading.get_ident(), file, state_of(file))
    last, houses = _open.pop(key, (number, iter(())))
    houses = _stream(file) if number <= last else houses
    for found, text in houses:
        if found == number:
            _open[key] = number, houses
            for oldest in list(_open)[:-_MOST_OPEN]:
                _open.pop(oldest, None)
            return text
    raise SourceError(f"{file.name}:{number}: is not there", code="house-missing", where=file)


def _find_regions(things: Sequence[_Thing], rooms: Sequence[_Room]) -> list[int]:
    """Return the room of every thing; one of no room is the building's."""
    matches = [_OF_ROOM.search(thing.id) for thing in things]
    regions = [int(match[1]) if match else -1 for match in matches]
    numbers = {room.number for room in rooms}
    astray = [at for at, region in enumerate(regions) if region not in numbers]
    found = _find_rooms([things[at].position for at in astray], rooms)
    for at, region in zip(astray, found, strict=True):
        regions[at] = region
    return regions


def _find_rooms(positions: Sequence[Position], rooms: Sequence[_Room]) -> list[int]:
    """Return the first room whose floor is below each position; -1, the null region, without."""
    if not positions:
        return []
    import shapely  # Imported here because importing shapely is slow.

    points = np.array([(at.x, at.z) for at in positions])
    found = np.full(len(points), -1)
    for room in reversed(rooms):
        floor = shapely.Polygon([(at.x, at.z) for at in room.corners])
        shapely.prepare(floor)
        found[shapely.contains_xy(floor, points)] = room.number
    numbers: list[int] = found.tolist()
    return numbers


def _describe_rooms(house: _House) -> list[AnnotatedRoom]:
    tops: dict[str | None, float] = {}
    for wall in house.walls:
        highest = max((corner.y for corner in wall.polygon), default=-np.inf)
        tops[wall.room_id] = max(highest, tops.get(wall.room_id, highest))
    return [_describe(room, tops.get(room.id, -np.inf)) for room in house.rooms]


def _describe(room: _Room, top: float) -> AnnotatedRoom:
    """Return a room with its floor: its area is the polygon's, its footprint the hull of that."""
    corners = np.array([_upright(corner) for corner in room.corners])
    area = measure_area([(x, y) for x, y, _ in corners])
    floor = corners[:, 2].min()
    ends = np.vstack([corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)])
    return AnnotatedRoom(
        region=room.number,
        source_label=room.room_type,
        box=Box.around(np.column_stack([ends, [floor, max(floor, top)]])),
        footprint=surround(corners[:, :2]),
        floor_area=area,
    )


def _list_doors(house: _House) -> list[tuple[int, int]]:
    """Return the pairs of rooms that doors join; other doors lead outside."""
    rooms = {room.id: room.number for room in house.rooms}
    ends = ((rooms.get(door.room0), rooms.get(door.room1)) for door in house.doors)
    return [(a, b) for a, b in ends if a is not None and b is not None and a != b]


def _upright(position: Position) -> tuple[float, float, float]:
    """Return a position with Z up; swapping two axes makes a left-handed frame right-handed."""
    return position.x, position.z, position.y


ROW = SourceRow(
    summary="ProcTHOR's houses, JSON lines or an array, gzip or not",
    open=_ProcTHORHouses,
    terms=Terms(
        licence="Apache-2.0",
        licence_url="https://www.apache.org/licenses/LICENSE-2.0",
        homepage="https://procthor.allenai.org",
        citation=(
            "Deitke et al., ProcTHOR: Large-Scale Embodied AI Using Procedural Generation, "
            "NeurIPS 2022, arXiv:2206.06994"
        ),
        sentence=(
            "ProcTHOR-10K is under the Apache licence 2.0; houses that others generated or "
            "changed have the terms of whoever published them."
        ),
    ),
    class_map="procthor45-v1",
)
