"""Measure on which piece of furniture of a room things are said to be, by what people chose.

    python scripts/measure/pieces.py --housekeep placements.csv --out docs/results/figures.json

The file has `object,split,room,receptacle,people_right`, of ten people (`receptacle_shares.py`).
The things of the split `val` taught nothing. Housekeep's own measure is the average precision of
the pieces of a room, of which those that 6 people chose are right. The log loss is that of what is
said of a room's pieces against the shares of all people's choices.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from receptacle_shares import WORDS
from results import ResultsTable, format_estimate, write_figures

from bsg_data.arrays import Bools, Floats
from bsg_models.belief.partial_graph import KnownRoom, SeenObject
from bsg_models.evaluation.bootstrap import estimate_value, weigh_buildings
from bsg_robot.things.pieces import find_pieces, furnish
from bsg_robot.things.things import find_receptacle, read_shares

VOTES = 6  # of ten people make a piece right
ROOMS = WORDS | {"childs_room": "bedroom"}  # of Housekeep, as robots call them
# thing → room → piece → people who chose it
Votes = Mapping[str, Mapping[str, Mapping[str, int]]]
Rank = Callable[[str, str, Sequence[str]], Floats]  # thing, room, pieces → a number for each


def rate(thing: str, room: str, pieces: Sequence[str]) -> Floats:
    """Return the shares that the library gives the pieces of a room, in a tidy home."""
    known = KnownRoom("room", hidden_share=1.0, room_type=room)
    objects = [SeenObject(str(n), 1, one, None, None) for n, one in enumerate(pieces)]
    found = furnish(thing, known, find_pieces(objects), classes=(), unseen=np.zeros(0), tidy=1.0)
    return np.ones(len(pieces)) if found is None else found.shares({})[:-1]


def count_choices(_: str, room: str, pieces: Sequence[str]) -> Floats:
    """Return how often people chose each piece in such a room, whatever the thing."""
    said = read_shares()
    row = said.rooms.index(room) if room in said.rooms else slice(None)
    shares = np.atleast_2d(said.belongs[row]).mean(axis=0)
    kinds = [find_receptacle(piece) for piece in pieces]
    return np.array([shares[[*kind.like]].mean() if kind else 0.0 for kind in kinds])


def rank_alike(_: str, __: str, pieces: Sequence[str]) -> Floats:
    """Return the same for each piece."""
    return np.ones(len(pieces))


WAYS: Mapping[str, Rank] = {
    "ours": rate,
    "how often people chose a piece": count_choices,
    "chance": rank_alike,
}


def read_votes(path: Path, *, split: str) -> Votes:
    """Return how many people said that a thing belongs on a piece, for the things of a split."""
    votes: dict[str, dict[str, dict[str, int]]] = defaultdict(lambda: defaultdict(dict))
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["split"] == split:
                room = ROOMS.get(row["room"], row["room"].replace("_", " "))
                own = votes[row["object"].replace("_", " ")][room]
                own[row["receptacle"].replace("_", " ")] = int(float(row["people_right"]))
    return votes


def judge(votes: Votes, rank: Rank) -> Floats:
    """Return the sums of average precisions and of log losses, and their numbers, `[things, 4]`."""
    sums = np.zeros((len(votes), 4))
    for own, (thing, rooms) in zip(sums, votes.items(), strict=True):
        for room, pieces in rooms.items():
            said, shares = np.array([*pieces.values()], float), rank(thing, room, [*pieces])
            if (said >= VOTES).any():
                own += (average_precision(shares, said >= VOTES), 1, 0, 0)
            if said.any():
                likely = np.maximum(shares / shares.sum(), 1e-9)
                own += (0, 0, -(said / said.sum()) @ np.log(likely), 1)
    return sums


def average_precision(scores: Floats, right: Bools) -> float:
    """Return the mean precision at the ranks of those that are right.

    >>> float(average_precision(np.array([3.0, 2.0, 1.0]), np.array([True, False, True])).round(3))
    0.833
    """
    hits = right[np.argsort(-scores, kind="stable")]
    return float((hits.cumsum() / np.arange(1, len(hits) + 1))[hits].mean())


def tabulate(votes: Votes) -> ResultsTable:
    """Return both measures of each way, with intervals over things."""
    weights = weigh_buildings(len(votes), resamples=1000, seed=0).astype(float)
    rows = []
    for name, rank in WAYS.items():
        sums = judge(votes, rank).T @ weights
        means = (sums[[0, 2]] / sums[[1, 3]]).tolist()
        both = [estimate_value(m[0], np.array(m[1:]), nodes=len(votes)) for m in means]
        rows.append([name, *(format_estimate(one, digits=3) for one in both)])
    published = [["RoBERTa, tuned", "0.791", "–"], ["GloVe, tuned", "0.760", "–"]]
    reading = (
        f"{len(votes)} things that taught nothing, 95 % intervals over things. Pieces of a room, "
        f"ranked, against those that {VOTES} of 10 people chose; and log loss against the shares "
        "of people's choices."
    )
    header = ("by", "pieces of a room, mAP ↑", "log loss ↓")
    every = [*rows, *published]
    return ResultsTable("Pieces of a room, by people", header, every, reading, tested_on="unseen")


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--housekeep", type=Path, required=True, help="placements.csv")
    parser.add_argument("--out", type=Path, required=True, help="JSON of figures")
    options = parser.parse_args(argv)
    table = tabulate(read_votes(options.housekeep, split="val"))
    write_figures(
        options.out,
        "pieces",
        [table],
        argv=[__file__, *(argv or sys.argv[1:])],
        files=[options.housekeep],
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
