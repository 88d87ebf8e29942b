"""Read the table, written by hand, of what a room with a label holds."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.scene.class_space import read_published
from bsg_data.scene.room_label import list_room_labels

_TABLE = "hand-prior-v2.json"  # of `bsg_mappings`
_LEAST = 0.01  # no class is certainly absent from, or certainly in, a room


@dataclass(frozen=True, eq=False)
class HandPrior:
    """What the table says of L labels, in the order of `list_room_labels`, and C classes."""

    usual: Floats  # [L] P(label) of a room; 0 for a label that it does not list
    presence: Floats  # [L, C] P(such a room has at least one of the class)


def read_hand_prior(classes: tuple[str, ...]) -> HandPrior:
    """Return the shipped table for some classes."""
    table = json.loads(read_published(_TABLE))
    unlisted, none = table["unlisted"], {"weight": 0.0, "presence": {}}
    rooms = [table["room_types"].get(label, none) for label in list_room_labels()]
    weight = np.array([one["weight"] for one in rooms])
    presence = np.array(
        [[one["presence"].get(name, unlisted) for name in classes] for one in rooms]
    )
    return HandPrior(weight / weight.sum(), np.clip(presence, _LEAST, 1 - _LEAST))
