"""Room labels: map a source's name of a room to a common label.

`mappings/room-labels-v1.csv` has `source,source_label,label`. Rows of the source `any` hold
everyday words and count for every source. A row without a label marks a word that names no kind of
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
LAYOUTS = "layouts"  # the source name of labels in room layouts, for scenes of any source
_NUMBER = re.compile(r"[\s#]*[0-9]+$")


def label_of(source: str, source_label: str | None) -> str | None:
    """Return the common label of a room; None if the word names no kind of room or is unknown.

    The source's own rows count first, exactly as written: in Matterport3D `b` is a bedroom and `B`
    a bar.

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
    """Return a room's name in lower case, with spaces for `_` and `-`, without its number.

    >>> normalise_room("Walk-in_Closet_2")
    'walk in closet'
    """
    return _NUMBER.sub("", normalise_name(re.sub(r"[_-]", " ", name)))


@cache
def _read_labels() -> Mapping[tuple[str, str], str | None]:
    """Read the published rows, each exact and normalised."""
    header = ("source", "source_label", "label")
    rows = [row for _, row in read_rows(ROOM_LABELS, read_published(ROOM_LABELS), header)]
    spoken = {(source, normalise_room(word)): label or None for source, word, label in rows}
    return {**spoken, **{(source, word): label or None for source, word, label in rows}}
