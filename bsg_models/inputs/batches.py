"""Deal masked buildings in batches of one size, whatever the size of the stored parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from bsg_data.observation.masked_buildings import MaskedBuildings, stack_masked


def in_batches(parts: Iterable[MaskedBuildings], size: int) -> Iterator[MaskedBuildings]:
    """Yield the buildings of all parts in order, `size` at a time; the last batch is the rest.

    So a batch does not depend on how its buildings were stored. One part and one batch are in
    memory at a time.

    Args:
        parts: of one building or more each.
        size: buildings of a batch, 1 or more.
    """
    held: list[MaskedBuildings] = []
    number = 0  # of buildings in `held`, fewer than `size` between two parts
    for part in parts:
        first = 0
        while len(part) - first >= size - number:
            last = first + size - number
            held.append(_cut(part, first, last))
            yield _join(held)
            held, number, first = [], 0, last
        if first < len(part):
            held.append(_cut(part, first, len(part)))
            number += len(part) - first
    if held:
        yield _join(held)


def _cut(part: MaskedBuildings, first: int, last: int) -> MaskedBuildings:
    return part if last - first == len(part) else part.take(range(first, last))


def _join(parts: list[MaskedBuildings]) -> MaskedBuildings:
    return parts[0] if len(parts) == 1 else stack_masked(parts)
