"""Room labels: from what a source calls a room to one of the common labels.

`mappings/room-labels-v1.csv` has `source,source_label,label`. The rows of `any` are words that
people say, and count for every source; a row without a label says that its word names no kind of
room.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from bsg_data.scene.class_map import normalise_name
from bsg_data.scene.class_space import read_published, read_rows

ROOM_LABELS = "room-labels-v1.csv"
ANY_SOURCE = "any"
LAYOUTS = "layouts"  # the source of labels in room layouts, whatever the scenes are of
_NUMBER = re.compile(r"[\s#]*[0-9]+$")


def label_of(source: str, source_label: str | None) -> str | None:
    """Return the common label of a room; None for one that says nothing, or that nobody lists.

    What the source itself says by that word counts first, exactly as it is written: Matterport3D's
    `b` is a bedroom and its `B` a bar.

    Args:
        source: the kind of source, e.g. `behavior`; `layouts` for labels of room layouts.
        source_label: the source's own word.

    >>> label_of("mp3d", "b"), label_of("mp3d", "B"), label_of("table", "Master_Bedroom 2")
    ('bedroom', 'bar', 'bedroom')
    """
    if source_label is None:
        return None
    rows = _read_labels()
    spoken = normalise_room(source_label)
    for key in ((source, source_label), (source, spoken), (ANY_SOURCE, spoken)):
        if key in rows:
            return rows[key]
    return None


@cache
def list_room_labels() -> tuple[str, ...]:
    """Return the common room labels, sorted."""
    return tuple(sorted({label for label in _read_labels().values() if label is not None}))


def normalise_room(name: str) -> str:
    """Return a room's name with spaces for `_` and `-`, without case and without its number.

    >>> normalise_room("Walk-in_Closet_2")
    'walk in closet'
    """
    return _NUMBER.sub("", normalise_name(re.sub(r"[_-]", " ", name)))


@cache
def _read_labels() -> Mapping[tuple[str, str], str | None]:
    """Read the published rows, each as it is written and as people say it."""
    header = ("source", "source_label", "label")
    rows = [row for _, row in read_rows(ROOM_LABELS, read_published(ROOM_LABELS), header)]
    spoken = {(source, normalise_room(word)): label or None for source, word, label in rows}
    return {**spoken, **{(source, word): label or None for source, word, label in rows}}
