"""Read `hand-prior-v1.json`, written by hand: what a room with a label holds (docs/models.md)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.scene.room_label import list_room_labels

HAND_TABLE = Path(__file__).with_name("hand-prior-v1.json")
_LEAST = 0.01  # no class is certainly absent from, or certainly in, a room


@dataclass(frozen=True, eq=False)
class HandPrior:
    """What the table says of L labels, in the order of `list_room_labels`, and C classes."""

    usual: Floats  # [L] P(label) of a room; 0 for a label that it does not list
    presence: Floats  # [L, C] P(such a room has at least one of the class)


@cache
def read_hand_table() -> dict[str, Any]:
    """Return the table as it is written: `room_types`, and `unlisted` for other classes."""
    table: dict[str, Any] = json.loads(HAND_TABLE.read_bytes())
    return table


def read_hand_prior(classes: tuple[str, ...]) -> HandPrior:
    """Return the shipped table for some classes."""
    table = read_hand_table()
    unlisted, none = table["unlisted"], {"weight": 0.0, "presence": {}}
    rooms = [table["room_types"].get(label, none) for label in list_room_labels()]
    weight = np.array([room["weight"] for room in rooms])
    presence = np.array(
        [[room["presence"].get(name, unlisted) for name in classes] for room in rooms]
    )
    return HandPrior(weight / weight.sum(), np.clip(presence, _LEAST, 1 - _LEAST))
