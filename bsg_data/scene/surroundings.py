"""Surroundings: facts about a room and its building besides the objects.

These are the floor area, the type of the room, the kind of the building, and the source that names
and counts the objects. Each may be unknown. A mask hides none of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from typing import ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints
from bsg_data.errors import RecipeError
from bsg_data.recipes import read_number
from bsg_data.scene.room_label import ANY_SOURCE, label_of, list_room_labels, normalise_room
from bsg_data.spelling import SHOWN, ask_if_meant, show_value

# Models know each by its index here; add new kinds and sources at the end.
BUILDING_KINDS = ("home", "office", "school", "shop", "restaurant", "hotel", "hall")
KNOWN_SOURCES = ("hm3d", "behavior", "procthor", "mp3d")
EVIDENCE = ("floor_area", "labels", "building_kinds", "sources")

MAX_FLOOR_AREA = 1e5  # square metres, of a room: the largest halls that are built
RoomType = str | Mapping[str, float]  # a label, or labels with their probabilities
Said = TypeVar("Said")
Read = TypeVar("Read")
_NOTHING = frozenset({"", "other", "unknown"})  # words that name no kind
_ROUNDING = 1e-6  # by which probabilities may add up to more than 1
_MOST_LABELS = 1000  # of one room


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Facts about N nodes of interest in B buildings besides their objects, with L room labels.

    Attributes:
        floor_area: `[N]` square metres; NaN if unknown, and for buildings.
        labels: `[N, L]` distributions over `list_room_labels()`; all 0 if unknown.
        building_kinds: `[B]` names of `BUILDING_KINDS`; "" or another word means unknown.
        sources: `[B]` kinds of source with the same names and counting of objects, e.g. `hm3d`; ""
            if unknown.
    """

    UNKNOWN: ClassVar[int] = -1  # the index of a kind or a source that is not known

    floor_area: Floats
    labels: npt.NDArray[np.float32]
    building_kinds: tuple[str, ...]
    sources: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of nodes N."""
        return len(self.floor_area)

    @classmethod
    def unknown(cls, *, nodes: int, buildings: int = 1) -> Surroundings:
        """Return surroundings that are all unknown."""
        return cls(
            np.full(nodes, np.nan),
            np.zeros((nodes, len(list_room_labels())), dtype=np.float32),
            ("",) * buildings,
            ("",) * buildings,
        )

    @classmethod
    def of_rooms(
        cls,
        areas: Sequence[float | None],
        room_types: Sequence[RoomType | None],
        *,
        building_kind: str | None = None,
        source: str | None = None,
    ) -> Surroundings:
        """Return the surroundings of one building and its rooms; the building's node is first.

        Args:
            areas: `[R]` square metres of each room; None if unknown.
            room_types: `[R]` label of each room in any spelling, or labels with probabilities. If
                these sum to less than 1, the rest is spread evenly over all labels. None if
                unknown.
            building_kind: one of `BUILDING_KINDS`; None if unknown.
            source: kind of source; None if unknown.

        Raises:
            RecipeError: if an area, a label, a probability or a kind is impossible.
        """
        if len(areas) != len(room_types):
            raise RecipeError(
                f"expected areas and room types of the same rooms, found {len(areas)}"
                f" and {len(room_types)}"
            )
        return cls(
            np.array([None, *_of_each_room(check_floor_area, areas)], dtype=np.float64),
            np.stack([_spread(None), *_of_each_room(_spread, room_types)]),
            (check_building_kind(building_kind) or "",),
            (source or "",),
        )

    @property
    def building_kind_index(self) -> Ints:
        """Index of each building's kind in `BUILDING_KINDS`, `[B]`; `UNKNOWN` for any other."""
        return _places(self.building_kinds, BUILDING_KINDS)

    @property
    def source_index(self) -> Ints:
        """Index of each building's source in `KNOWN_SOURCES`, `[B]`; `UNKNOWN` for any other."""
        return _places(self.sources, KNOWN_SOURCES)

    def take(self, rows: slice, *, buildings: slice) -> Surroundings:
        """Return the surroundings of a range of nodes and their buildings."""
        return replace(
            self,
            floor_area=self.floor_area[rows],
            labels=self.labels[rows],
            building_kinds=self.building_kinds[buildings],
            sources=self.sources[buildings],
        )

    def gather(self, rows: Ints, *, buildings: Ints) -> Surroundings:
        """Return the surroundings of nodes by their numbers, and of their buildings."""
        numbers = buildings.tolist()
        return replace(
            self,
            floor_area=self.floor_area[rows],
            labels=self.labels[rows],
            building_kinds=tuple(self.building_kinds[number] for number in numbers),
            sources=tuple(self.sources[number] for number in numbers),
        )

    def without(self, *evidence: str) -> Surroundings:
        """Return a copy with some evidence set to unknown.

        Args:
            evidence: names of `EVIDENCE`.

        Raises:
            RecipeError: if a name is unknown.
        """
        nothing = self.unknown(nodes=len(self), buildings=len(self.sources))
        for name in evidence:
            if name not in EVIDENCE:
                raise RecipeError(f"{name!r} is no evidence; expected one of {', '.join(EVIDENCE)}")
        return replace(self, **{name: getattr(nothing, name) for name in evidence})


def stack_surroundings(parts: Sequence[Surroundings]) -> Surroundings:
    """Return the surroundings of several buildings, one or more, in order."""
    return Surroundings(
        np.concatenate([part.floor_area for part in parts]),
        np.concatenate([part.labels for part in parts]),
        tuple(chain.from_iterable(part.building_kinds for part in parts)),
        tuple(chain.from_iterable(part.sources for part in parts)),
    )


def repeat_surroundings(part: Surroundings, times: int) -> Surroundings:
    """Return the surroundings of the same buildings, repeated several times."""
    return Surroundings(
        np.tile(part.floor_area, times),
        np.tile(part.labels, (times, 1)),
        part.building_kinds * times,
        part.sources * times,
    )


def check_floor_area(area: float | None) -> float | None:
    """Return a floor area in square metres, unchanged.

    Raises:
        RecipeError: if no room can have this area.
    """
    if area is None or is_floor_area(area):
        return area
    raise RecipeError(
        f"expected a floor area in square metres, above 0 and at most {MAX_FLOOR_AREA:,.0f}, "
        f"found {area}"
    )


def is_floor_area(area: float | None) -> bool:
    """Say whether a room can have a floor area, in square metres.

    >>> is_floor_area(12.5), is_floor_area(0), is_floor_area(float("nan"))
    (True, False, False)
    """
    return area is not None and math.isfinite(area) and 0 < area <= MAX_FLOOR_AREA


def check_building_kind(kind: str | None) -> str | None:
    """Return one of `BUILDING_KINDS`; None for a word that names no kind, such as `other`.

    Raises:
        RecipeError: if the kind is unknown.
    """
    spoken = "" if kind is None else normalise_room(kind)
    if spoken in _NOTHING:
        return None
    if spoken not in BUILDING_KINDS:
        raise RecipeError(
            f"expected a kind of building, found {str(kind)[:SHOWN]!r}; known are "
            f"{', '.join(BUILDING_KINDS)}; leave it out, or say `other`"
        )
    return spoken


def check_room_type(said: RoomType | None) -> RoomType | None:
    """Return the type of a room in common labels; probabilities of equal labels are summed.

    >>> check_room_type("Hallway"), check_room_type({"hall": 0.5, "corridor": 0.25})
    ('corridor', {'corridor': 0.75})

    Args:
        said: a label in any spelling that `mappings/room-labels-v1.csv` lists for all sources, or
            labels with probabilities whose sum is at most 1.

    Raises:
        RecipeError: for an unknown label or an impossible probability.
    """
    if said is None or isinstance(said, str):
        return None if said is None else _find_label(said)
    if not isinstance(said, Mapping):
        raise RecipeError(
            f"expected a room label, or labels with their probabilities, found {show_value(said)}"
        )
    if not said:
        raise RecipeError("expected at least one label, found none; leave it out, or give null")
    if len(said) > _MOST_LABELS:
        raise RecipeError(f"expected at most {_MOST_LABELS} labels, found {len(said)}")
    found: dict[str, float] = {}
    for word, share in said.items():
        if not isinstance(word, str):
            raise RecipeError(f"expected a room label, found {show_value(word)}")
        most, wanted = 1 + _ROUNDING, "a probability, 0 to 1"
        share = read_number(show_value(word), share, most=most, wanted=wanted)
        label = _find_label(word)
        if label is not None and share > 0:
            found[label] = found.get(label, 0.0) + share
    total = math.fsum(said.values())
    if total > 1 + _ROUNDING:
        raise RecipeError(f"expected probabilities that add up to 1 or less, found {total:g}")
    return next(iter(found)) if list(found.values()) == [1.0] else found or None


def label_rows(labels: Sequence[str | None]) -> npt.NDArray[np.float32]:
    """Return labels of rooms as rows `[R, L]`; all 0 for a label that this version lacks."""
    places = _label_places()
    rows = np.zeros((len(labels), len(places)), dtype=np.float32)
    for row, label in enumerate(labels):
        if label is not None and label in places:
            rows[row, places[label]] = 1
    return rows


def _of_each_room(read: Callable[[Said], Read], said: Iterable[Said]) -> Iterator[Read]:
    """Yield the result of `read` for each room; an error names the room."""
    for number, one in enumerate(said, 1):
        try:
            yield read(one)
        except RecipeError as error:
            raise RecipeError(f"room {number}: {error}") from error


def _find_label(word: str) -> str | None:
    """Return the common label of a word; None if the word means unknown."""
    spoken = normalise_room(word)
    if spoken in _NOTHING:
        return None
    label = label_of(ANY_SOURCE, word)
    if label is None:
        asked = ask_if_meant(spoken, list_room_labels(), most=3)
        hint = asked or "leave it out, or say `other`"
        raise RecipeError(f"expected a room label, found {word[:SHOWN]!r}; {hint}")
    return label


def _spread(said: RoomType | None) -> npt.NDArray[np.float32]:
    """Return the distribution over the labels `[L]` of a room type; all 0 for None."""
    places = _label_places()
    row = np.zeros(len(places))
    known = check_room_type(said)
    if known is not None:
        shares = {known: 1.0} if isinstance(known, str) else known
        for label, share in shares.items():
            row[places[label]] = share
        row += max(0.0, 1 - row.sum()) / len(row)
        row /= row.sum()
    return row.astype(np.float32)


@cache
def _label_places() -> Mapping[str, int]:
    """Return the place of every common room label in their order."""
    return {label: place for place, label in enumerate(list_room_labels())}


def _places(words: Sequence[str], listed: Sequence[str]) -> Ints:
    places = {word: place for place, word in enumerate(listed)}
    return np.array([places.get(word, Surroundings.UNKNOWN) for word in words], dtype=np.int64)
