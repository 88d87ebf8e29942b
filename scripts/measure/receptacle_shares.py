"""Make bsg_robot/tables/receptacle-shares-v1.csv: how often people chose each piece of furniture.

    python scripts/measure/receptacle_shares.py --housekeep PLACEMENTS --out FILE

PLACEMENTS has `object,split,room,receptacle,people_right,people_misplaced`. The things of the split
`train` count, all together. A piece about which nobody was asked in a room gets the sum of the
effects of room and piece on the log odds, shrunk towards 0.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.files import write_bytes

PEOPLE = 10
SMOOTH = 0.5  # people added to both answers
SHRINK = 0.5  # of the effects of rooms and pieces
_LEFT_OUT = ("childs_room",)  # robots call it a bedroom
WORDS = {  # of Housekeep, and ours
    "exercise_room": "gym",
    "home_office": "office",
    "lobby": "entrance",
    "pantry_room": "pantry",
    "television_room": "tv room",
    "fridge": "refrigerator",
    "washer": "washing machine",
    "dryer": "clothes dryer",
    "sofa": "couch",
    "sofa_chair": "armchair",
}
_ANSWERS = ("people_right", "people_misplaced")
Cell = tuple[str, str]  # a room and a piece


def read_shares(path: Path) -> dict[Cell, Floats]:
    """Return the shares of people who chose each piece in each room, in both questions, `[2]`."""
    said: dict[Cell, list[tuple[int, int]]] = defaultdict(list)
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["split"] == "train":
                right, misplaced = (int(float(row[one])) for one in _ANSWERS)
                said[row["room"], row["receptacle"]].append((right, misplaced))
    return {
        cell: (np.sum(answers, axis=0) + SMOOTH) / (PEOPLE * len(answers) + 2 * SMOOTH)
        for cell, answers in said.items()
    }


def fill(shares: Mapping[Cell, Floats]) -> dict[Cell, Floats]:
    """Return the shares of all rooms and pieces, also where nobody was asked."""
    rooms, pieces = (sorted({cell[axis] for cell in shares}) for axis in (0, 1))
    asked = np.array(
        [
            [room == one for one in rooms] + [piece == one for one in pieces]
            for room, piece in shares
        ],
        dtype=float,
    )
    odds = np.array([np.log(share / (1 - share)) for share in shares.values()])
    mean = odds.mean(axis=0)
    ridge = asked.T @ asked + SHRINK * np.eye(asked.shape[1])
    effects = np.linalg.solve(ridge, asked.T @ (odds - mean))
    found = {}
    for i, room in enumerate(rooms):
        for j, piece in enumerate(pieces):
            added = mean + effects[i] + effects[len(rooms) + j]
            found[room, piece] = shares.get((room, piece), 1 / (1 + np.exp(-added)))
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--housekeep", type=Path, required=True, help="placements.csv")
    parser.add_argument("--out", type=Path, required=True, help="CSV")
    options = parser.parse_args(argv)
    shares = read_shares(options.housekeep)
    rows = [
        [
            *(WORDS.get(one, one.replace("_", " ")) for one in (room, piece)),
            *(f"{one:.3f}" for one in both),
            "yes" if (room, piece) in shares else "no",
        ]
        for (room, piece), both in fill(shares).items()
        if room not in _LEFT_OUT
    ]
    header = ["room", "receptacle", "belongs", "untidy", "asked"]
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows([header, *sorted(rows)])
    write_bytes(options.out, table.getvalue().encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
