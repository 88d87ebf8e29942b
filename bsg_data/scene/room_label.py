"""Room labels: common words for kinds of rooms, and what the words of sources and robots mean.

`mappings/room-labels-v2.csv` has `source,source_label,label`. Rows of the source `any` hold
everyday words and count for every source. A row without a label marks a word that names no kind of
room. Models were trained with the labels of `list_room_labels`; a row of the source `nearest` has
the one of these by which they read another, such as an infirmary for an examination room.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import cache

import numpy as np
import numpy.typing as npt

from bsg_data.errors import RecipeError
from bsg_data.recipes import read_number
from bsg_data.scene.class_map import normalise_name
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.spelling import nearest_names, show_value

RoomType = str | Mapping[str, float]  # a label, or labels with their probabilities
LAYOUTS = "layouts"  # the source name of labels in room layouts, for scenes of any source
NO_KIND = frozenset({"", "other", "unknown"})  # words that name no kind of room or building
_FILE = "room-labels-v2.csv"
_ANY_SOURCE = "any"
_NEAREST = "nearest"
_NUMBER = re.compile(r"[\s#]*[0-9]+$")
_ROUNDING = 1e-6  # by which probabilities may add up to more than 1
_MOST_LABELS = 1000  # of one room


def label_of(source: str, source_label: str | None) -> str | None:
    """Return the common label of a room; None if the word names no kind of room or is unknown.

    The rows of the kind of source count first, exactly as written: in Matterport3D `b` is a bedroom
    and `B` a bar.

    >>> label_of("mp3d", "b"), label_of("mp3d", "B"), label_of("table", "Master_Bedroom 2")
    ('bedroom', 'bar', 'bedroom')
    """
    if source_label is None:
        return None
    rows = _read_labels()
    spoken = normalise_room(source_label)
    for key in ((source, source_label), (source, spoken), (_ANY_SOURCE, spoken)):
        if key in rows:
            return rows[key]
    return None


@cache
def list_room_labels() -> tuple[str, ...]:
    """Return the common room labels that models read, sorted."""
    labels = {label for label in _read_labels().values() if label is not None}
    return tuple(sorted(label for label in labels if known_label(label) == label))


def known_label(label: str) -> str:
    """Return the label by which models read a common label: itself, or the nearest they know.

    >>> known_label("kitchen"), known_label("examination room")
    ('kitchen', 'infirmary')
    """
    return _read_labels().get((_NEAREST, label)) or label


def normalise_room(name: str) -> str:
    """Return a room's name in lower case, with spaces for `_` and `-`, without its number.

    >>> normalise_room("Walk-in_Closet_2")
    'walk in closet'
    """
    return _NUMBER.sub("", normalise_name(re.sub(r"[_-]", " ", name)))


def check_room_type(said: RoomType | None) -> RoomType | None:
    """Return the type of a room in common labels; probabilities of equal labels are summed.

    A word that no label is known for stays, and counts as unknown; see `explain_room_type`.

    >>> check_room_type("Hallway"), check_room_type({"hall": 0.5, "corridor": 0.25})
    ('corridor', {'corridor': 0.75})

    Raises:
        RecipeError: for an impossible probability or a sum above 1.
    """
    if said is None or isinstance(said, str):
        return None if said is None else _find_label(said)
    if not isinstance(said, Mapping) or not all(isinstance(word, str) for word in said):
        raise RecipeError(
            f"expected a room label, or labels with their probabilities, found {show_value(said)}"
        )
    if not 1 <= len(said) <= _MOST_LABELS:
        raise RecipeError(
            f"expected 1 to {_MOST_LABELS} labels, found {len(said)}; leave it out, or give null"
        )
    found: dict[str, float] = {}
    for word, share in said.items():
        most, wanted = 1 + _ROUNDING, "a probability, 0 to 1"
        share = read_number(show_value(word), share, most=most, wanted=wanted)
        label = _find_label(word)
        if label is not None and share > 0:
            found[label] = found.get(label, 0.0) + share
    total = math.fsum(said.values())
    if total > 1 + _ROUNDING:
        raise RecipeError(f"expected probabilities that add up to 1 or less, found {total:g}")
    return next(iter(found)) if list(found.values()) == [1.0] else found or None


def explain_room_type(said: RoomType | None) -> dict[str, str]:
    """Return word → how models read it, of the words of a type that they do not know.

    >>> explain_room_type({"Küche": 0.5, "patient room": 0.25, "hall": 0.25})
    {'Küche': 'unknown (nearest: kitchen)', 'patient room': 'infirmary'}
    """
    known = check_room_type(said)
    words = () if known is None else (known,) if isinstance(known, str) else tuple(known)
    return {
        word: read if read in list_room_labels() else _name_nearest(word)
        for word in words
        if (read := known_label(word)) != word or read not in list_room_labels()
    }


def _name_nearest(word: str) -> str:
    near = nearest_names(normalise_room(word), list_room_labels())
    return f"unknown (nearest: {', '.join(near)})" if near else "unknown"


@cache
def _place_labels() -> dict[str, int]:
    return {label: place for place, label in enumerate(list_room_labels())}


def spread_labels(said: RoomType | None) -> npt.NDArray[np.float32]:
    """Return a type as a distribution over the labels `[L]`; all 0 if it says nothing.

    What its probabilities leave is spread evenly over all labels.

    Raises:
        RecipeError: as `check_room_type`.
    """
    known, places = check_room_type(said), _place_labels()
    row = np.zeros(len(places))
    for label, share in ({known: 1.0} if isinstance(known, str) else known or {}).items():
        if (read := known_label(label)) in places:
            row[places[read]] += share
    if row.any():
        row += max(0.0, 1 - row.sum()) / len(row)
        row /= row.sum()
    return row.astype(np.float32)


def _find_label(word: str) -> str | None:
    """Return the common label of a word; the word itself if none is known; None if it says none."""
    if normalise_room(word) in NO_KIND:
        return None
    return label_of(_ANY_SOURCE, word) or word


@cache
def _read_labels() -> Mapping[tuple[str, str], str | None]:
    """Read the published rows, each exact and normalised."""
    header = ("source", "source_label", "label")
    rows = [row for _, row in read_rows(_FILE, read_published(_FILE), header)]
    spoken = {(source, normalise_room(word)): label or None for source, word, label in rows}
    return {**spoken, **{(source, word): label or None for source, word, label in rows}}
