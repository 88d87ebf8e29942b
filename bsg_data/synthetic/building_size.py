"""Synthetic buildings of a given size, larger than any real one, to test large inputs.

Their rooms have the same types and kinds of objects as those of usual buildings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.synthetic.rates import SyntheticError, SyntheticRates

MOST_ROOMS = 100_000
MOST_OBJECTS = 4_000_000  # each has a colour of its own, of 16.7 million
MOST_ROOMS_OF_MESH = 100  # takes ten seconds; larger meshes than any of HM3D prove nothing more
MOST_OBJECTS_OF_MESH = 10_000

Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class BuildingSize:
    """The size of buildings; None means the usual random size.

    Attributes:
        rooms: number of rooms, 1 to 100,000.
        objects: number of objects in the rooms, at least the number of rooms, at most 4,000,000.
    """

    rooms: int | None = None
    objects: int | None = None

    @property
    def name(self) -> str:
        """A name for this size."""
        return f"{self.rooms or 'any'}-rooms-{self.objects or 'any'}-objects"

    def require_possible(self, rates: SyntheticRates, *, meshes: bool) -> None:
        """Refuse an impossible size, or, with meshes, a size too large for a mesh.

        Raises:
            SyntheticError: naming what was expected and what was found.
        """
        usual = len(rates.rooms) - 1
        least = usual if self.rooms is None else self.rooms  # objects: no room is empty
        most_rooms, most = MOST_ROOMS, MOST_OBJECTS
        what = ""
        if meshes:
            most_rooms, most, what = MOST_ROOMS_OF_MESH, MOST_OBJECTS_OF_MESH, " with a mesh"
        if self.rooms is not None and not 1 <= self.rooms <= most_rooms:
            raise SyntheticError(
                f"rooms of buildings{what}: expected 1 to {most_rooms:,}, found {self.rooms:,}"
            )
        if self.objects is not None and not least <= self.objects <= most:
            raise SyntheticError(
                f"objects of buildings{what}: expected {least:,} (one per room) to {most:,}, found "
                f"{self.objects:,}"
            )


def draw_many_types(rates: SyntheticRates, rooms: int, rng: np.random.Generator) -> list[int]:
    """Sample the types of more rooms than any fitted building has, in order of types.

    Types are as frequent as in the largest buildings that were fitted; each room is by itself.
    """
    _, counts = rates.bins[-1]
    means = np.array([np.average(np.arange(len(some)), weights=some) for some in counts])
    numbers = rng.multinomial(rooms, means / means.sum())
    return [int(kind) for kind in np.repeat(np.arange(len(means)), numbers)]


def share_objects(counts: Counts, objects: int, rng: np.random.Generator) -> Counts:
    """Return counts per room and category `[R, C]` of a stated sum, in proportion to others.

    Every room has at least one object.
    """
    some = np.array([_take_one(room, rng) for room in counts])
    return some + rng.multinomial(objects - len(counts), counts.ravel() / counts.sum()).reshape(
        counts.shape
    )


def _take_one(room: Counts, rng: np.random.Generator) -> Counts:
    return rng.multinomial(1, room / room.sum())
