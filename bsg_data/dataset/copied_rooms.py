"""Group buildings with copied rooms, so that all of a group go to the same fold.

Some sources furnish several buildings with the same rooms. A model that was trained on one such
building knows the others.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence

from bsg_data.dataset.dataset import Dataset

LEAST_THINGS = 5  # smaller rooms can be equal by chance


def group_copies(rooms: Mapping[str, Sequence[Hashable]]) -> list[tuple[str, ...]]:
    """Return the groups of buildings that share rooms, directly or through others, sorted.

    Args:
        rooms: scene id → the contents of its larger rooms; equal contents are copies.

    >>> group_copies({"a": [1, 2], "b": [3], "c": [2, 4], "d": [4], "e": []})
    [('a', 'c', 'd'), ('b',), ('e',)]
    """
    group_of = {scene: {scene} for scene in rooms}
    first: dict[Hashable, str] = {}
    for scene, contents in rooms.items():
        for content in contents:
            other = first.setdefault(content, scene)
            joined = group_of[other] | group_of[scene]
            group_of.update(dict.fromkeys(joined, joined))
    return sorted({tuple(sorted(group)) for group in group_of.values()})


def deal_groups(groups: Sequence[tuple[str, ...]], *, number: int) -> dict[str, int]:
    """Return scene id → fold: the largest group first, each into the fold with the fewest scenes.

    >>> deal_groups([("a", "c", "d"), ("b",), ("e",)], number=2)
    {'a': 0, 'c': 0, 'd': 0, 'b': 1, 'e': 1}
    """
    sizes = [0] * number
    folds = {}
    for group in sorted(groups, key=lambda group: (-len(group), group)):
        fold = sizes.index(min(sizes))
        sizes[fold] += len(group)
        folds.update(dict.fromkeys(group, fold))
    return folds


def list_contents(data: Dataset, scene: str) -> Iterator[Hashable]:
    """Yield the contents of each larger room of a scene: counts of classes and categories."""
    cells, others = data.cells(scene), data.others(scene)
    for room in range(1, len(cells)):
        if cells[room].sum() + others.cells[room].sum() >= LEAST_THINGS:
            counted = zip(others.categories, others.cells[room].tolist(), strict=True)
            outside = frozenset((name, count) for name, count in counted if count)
            yield cells[room].tobytes(), outside
