"""Say what a home has taught in rows of texts, for a page."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from typing import Any

from bsg_models.belief.clock import say_ago
from bsg_models.belief.partial_graph import PartialGraph, Sighting

_MOST_THINGS = 20
_MOST_PLACES = 3  # of each


class Taught:
    """What a partial graph remembers, and what people have said."""

    def __init__(self, partial: PartialGraph) -> None:
        self._partial = partial
        self._rooms = {room.name: room.label or room.name for room in partial.rooms}
        self._pieces = {obj.name: obj.raw_category for obj in partial.objects}

    def row(self, habit: Mapping[str, Any]) -> list[str]:
        """Return a place of a thing, its share, sightings, the last, and whether it is told."""
        room = self._rooms.get(habit["room"], habit["room"] or "elsewhere")
        seen = self._count(habit["sightings"], habit["last"])
        is_told = "yes" if habit["told"] else ""
        return [self._name(room, habit["piece"]), f"{100 * habit['share']:.0f} %", *seen, is_told]

    def rows(self) -> list[list[str]]:
        """Return of each thing its places, sightings, the last, and what people say of it."""
        seen, customs = self._list_sightings(), self._list_told()
        names = ["in no room", *self._rooms.values()]
        rows = []
        things = sorted({*seen, *customs}, key=lambda thing: (-len(seen[thing]), thing))
        for thing in things[:_MOST_THINGS]:
            places = Counter((sighting.room_index, sighting.on) for sighting in seen[thing])
            often = [
                f"{self._name(names[room], on)}: {times}"
                for (room, on), times in places.most_common(_MOST_PLACES)
            ]
            if (more := len(places) - _MOST_PLACES) > 0:
                often.append(f"and {more:,} more")
            last = max((sighting.time for sighting in seen[thing]), default=None)
            counted = self._count(len(seen[thing]), last)
            rows.append([thing, "; ".join(often), *counted, "; ".join(customs[thing])])
        if (more := len(things) - _MOST_THINGS) > 0:
            rows.append([f"and {more:,} more things", "", "", "", ""])
        return rows

    def _list_sightings(self) -> dict[str, list[Sighting]]:
        """Return word → its sightings, of things that were elsewhere before."""
        seen: dict[str, list[Sighting]] = defaultdict(list)
        for remembered in self._partial.memory:
            seen[remembered.raw_category] += remembered.sightings
        for obj in self._partial.objects:
            if obj.raw_category in seen and obj.time is not None:
                seen[obj.raw_category].append(Sighting(obj.time, obj.room_index, obj.on))
        return seen

    def _list_told(self) -> dict[str, list[str]]:
        customs: dict[str, list[str]] = defaultdict(list)
        names = ["", *self._rooms.values()]
        for custom in self._partial.customs:
            place = self._name(names[custom.room_index or 0], custom.at)
            customs[custom.thing].append(f"never: {place}" if custom.never else place)
        return customs

    def _name(self, room: str, piece: str | None) -> str:
        """Return a place in words: a room, and a piece of furniture."""
        return ", ".join(filter(None, (room, piece and self._pieces.get(piece, piece))))

    def _count(self, sightings: int, last: str | float | None) -> list[str]:
        now = self._partial.now
        ago = "" if last is None or now is None else say_ago(last, now)
        return [f"{sightings:,}" if sightings else "", ago]
