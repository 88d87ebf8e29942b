"""Serve the prior of a search planner: `object_find_prob(robot, location, object)`.

RAIL-group/railroad calls such a function before every decision, twice for each robot, location and
object. Its locations may be rooms, or furniture inside rooms.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.partial_graph import PartialGraph
from bsg_models.robot.seen_building import Place, SeenBuilding
from bsg_models.robot.words import find_room

_NUMBERED = re.compile(r"(.+?)_[0-9]+")  # cup_4: one cup of several, as simulators name them
_ON_ITS_WAY = "_loc"  # suffix of a robot's name: where railroad puts it after an interrupted move
_LISTED = 8  # locations listed in an error


class FindProbability:
    """The probability that a search of a location finds a thing, as a planner asks for it.

    The unsearched locations of a room share it by size. If the room hides a thing with probability
    p, a location with the share s of the room hides it with 1 − (1 − p)^s, so the room hides none
    exactly if no location does. An object seen in the room is at one of these locations, at each
    with probability s. For a searched location the answer is 1 or 0.

    A thing is any word. A number at its end (`cup_4`) means one of several; a seen object counts as
    this one only if it has this very id.

    Examples:
        >>> probability = FindProbability(seen, {"sofa": "living", "start": None})  # doctest: +SKIP
        >>> probability("robot1", "sofa", "remote control")  # doctest: +SKIP
        0.41
    """

    def __init__(
        self,
        seen: SeenBuilding,
        locations: Mapping[str, str | None] | None = None,
        *,
        sizes: Mapping[str, float] | None = None,
        words: Mapping[str, str] | None = None,
        otherwise: float | None = None,
    ) -> None:
        """Start with what a robot has seen; later changes of `seen` change the answers.

        Args:
            seen: the building.
            locations: the planner's location → its room, by id or label; None for a place that
                holds nothing, such as the start. Without it, each room is a location.
            sizes: location → size, compared within a room: surface, or number of things. The
                default size is 1.
            words: the planner's name of a thing → a word for it, if the name is not a word.
            otherwise: probability of a word that means no thing; None raises.

        Raises:
            RecipeError: if a room is unknown, one of `words` means no thing, a size is not above 0,
                or `otherwise` is not a probability.
        """
        self.seen = seen
        self._rooms: dict[str, int | None] = {}
        self._sizes = dict(sizes or {})
        self._words = dict(words or {})
        self._otherwise = otherwise
        self._searched: set[str] = set()
        self._found: dict[str, str] = {}  # thing → the location where it was found
        self._graph: PartialGraph | None = None  # the graph that the cached places belong to
        self._places: dict[str, dict[str | None, Place] | None] = {}  # thing → room → place
        if otherwise is not None and not 0 <= otherwise <= 1:
            raise RecipeError(
                f"otherwise: expected 0 to 1, found {otherwise}", code="no-probability"
            )
        every = {room: room for room in seen.rooms} if locations is None else locations
        for word in self._words.values():
            seen.understand(word)
        for location, room in every.items():
            self.add(location, room)
        for location, size in self._sizes.items():
            self._require(location)
            if not (size > 0 and math.isfinite(size)):
                raise RecipeError(
                    f"sizes: {location!r}: expected more than 0, found {size}",
                    code="size-impossible",
                    where=location,
                )

    def add(self, location: str, room: str | None) -> None:
        """Add a location in a room, by id or label, or one that holds nothing (None)."""
        self._rooms[location] = None if room is None else find_room(self.seen.graph, room)

    def __call__(self, robot: str, location: str, thing: str) -> float:
        """Return P(a search of the location finds the thing).

        Args:
            robot: its name, which changes nothing: all robots share one knowledge.
            location: one of the planner's. A robot's position during a move (`robot1_loc`) holds
                nothing.
            thing: any word, with or without a number.

        Raises:
            RecipeError: if the location is unknown, or the word means no thing.
        """
        if self._graph is not self.seen.graph:
            self._graph, self._places = self.seen.graph, {}
            rooms = {obj.name: obj.room_index for obj in self._graph.objects}
            found = self._found.items()  # without what was moved
            self._found = {one: at for one, at in found if rooms.get(one) == self._rooms[at]}
        if location not in self._rooms and location.endswith(_ON_ITS_WAY):
            return 0.0
        return self._find(location, thing)

    def searched(self, location: str, found: Iterable[str] = ()) -> None:
        """Report that everything at a location was seen.

        A room counts as searched when all its locations are. Until then, each searched location
        lowers what the room hides by its share.

        Args:
            location: one of the planner's.
            found: the things that are there, by the planner's names, which become their ids.

        Raises:
            RecipeError: if the location is unknown, or holds nothing.
        """
        node = self._require(location)
        if node is None:
            raise RecipeError(
                f"{location!r} holds nothing, so it cannot be searched",
                code="location-empty",
                where=location,
            )
        room = self.seen.rooms[node - 1]
        for name in found:
            self.seen.saw(room, self._word(name), object_id=name)
            self._found[name] = location
        if location not in self._searched:
            before = self._unsearched(node)
            self._searched.add(location)
            left = self._unsearched(node) / before
            share = self.seen.graph.rooms[node - 1].share
            self.seen.entered(room, hidden_share=ShareBelief(share.mean * left, share.sd * left))

    def _find(self, location: str, thing: str) -> float:
        node = self._require(location)
        if thing in self._found:
            return float(self._found[thing] == location)
        if node is None:
            return 0.0
        if thing not in self._places:
            self._places[thing] = self._look(thing)
        places = self._places[thing]
        if places is None:
            return 0.0 if location in self._searched else float(self._otherwise or 0.0)
        place = places[self.seen.rooms[node - 1]]
        is_numbered = _NUMBERED.fullmatch(thing) is not None
        seen = [one for one in place.seen if one == thing or not is_numbered]
        if any(self._found.get(one) == location for one in seen):
            return 1.0
        if location in self._searched:
            return 0.0
        share = self._sizes.get(location, 1.0) / self._unsearched(node)
        if any(one not in self._found for one in seen):
            return share
        return float(1 - (1 - place.unseen) ** share)

    def _look(self, thing: str) -> dict[str | None, Place] | None:
        """Return where a thing may be; None if it means no thing and `otherwise` is set."""
        try:
            return {place.room: place for place in self.seen.where(self._word(thing))}
        except RecipeError:
            if self._otherwise is None:
                raise
            return None

    def _word(self, thing: str) -> str:
        numbered = _NUMBERED.fullmatch(thing)
        return self._words.get(thing, thing if numbered is None else numbered[1])

    def _unsearched(self, node: int) -> float:
        """Return the total size of a room's unsearched locations."""
        return sum(
            self._sizes.get(location, 1.0)
            for location, room in self._rooms.items()
            if room == node and location not in self._searched
        )

    def _require(self, location: str) -> int | None:
        """Return the room of a location, 1..R; None for one that holds nothing."""
        if location not in self._rooms:
            raise RecipeError(
                f"no location {location!r}: known are {', '.join([*self._rooms][:_LISTED])}; `add` "
                "adds a location with its room",
                code="location-unknown",
                where=location,
            )
        return self._rooms[location]
