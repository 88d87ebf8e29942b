"""Compute what each room adds to some means: likelihood, presence, calibration gaps.

A tally takes the truth of masked buildings, what was seen of them, and what a model expects. It
returns `Shares`: name → (`[N]` what each node adds, `[N]` its number of cells). A cell is a room
and a class. `building_means` makes means of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from building_means import Shares

from bsg_data.arrays import Ints
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.metric_rows import hidden_nll
from bsg_models.evaluation.metrics import Bools, Floats
from bsg_models.evaluation.truth import Truth

Tally = Callable[[Truth, MaskedBuildings, Expectation], Shares]
VIEWS = ("half-seen", "glimpsed", "unvisited")  # of rooms that hide something
LEAST = 1e-6  # a presence is moved this far from 0 and 1 before its logarithm is taken


def tally_all(*tallies: Tally) -> Tally:
    """Return a tally that combines several."""

    def tally(truth: Truth, masked: MaskedBuildings, found: Expectation) -> Shares:
        return {k: v for one in tallies for k, v in one(truth, masked, found).items()}

    return tally


def tally_likelihood(truth: Truth, masked: MaskedBuildings, found: Expectation) -> Shares:
    """Return `nll`: −log P(hidden counts), over the classes of every room."""
    rooms = (~truth.is_building).astype(float)
    return {"nll": (hidden_nll(truth, found) * rooms, rooms)}


def tally_views(truth: Truth, masked: MaskedBuildings, found: Expectation) -> Shares:
    """Return `nll/VIEW`, and `gap/VIEW`: presence minus outcome, for the `VIEWS` of rooms."""
    gap = (found.presence - (truth.hidden > 0)).sum(axis=1)
    loss = hidden_nll(truth, found)
    classes = truth.inputs.shape[1]
    shares = {}
    for view, rooms in view_rooms(masked).items():
        shares[f"nll/{view}"] = (loss * rooms, rooms.astype(float))
        shares[f"gap/{view}"] = (gap * rooms, classes * rooms.astype(float))
    return shares


def view_of(seen: Observation) -> Ints:
    """Return the index in `VIEWS` of each node's view, `[N]`; -1 for none.

    The robot was in a half-seen room, looked through the door of a glimpsed one, and saw nothing of
    an unvisited one.
    """
    share, partly = seen.hidden_share, (seen.hidden_share > 0) & (seen.hidden_share < 1)
    kinds = [partly & seen.visited, partly & ~seen.visited, share == 1]
    return np.where(seen.is_building, -1, np.select(kinds, range(len(VIEWS)), default=-1))


def view_rooms(masked: MaskedBuildings) -> Mapping[str, Bools]:
    """Return which nodes are rooms of each of the `VIEWS`, `[N]`."""
    view = view_of(masked.seen)
    return {name: view == number for number, name in enumerate(VIEWS)}


def tally_second(
    truth: Truth, masked: MaskedBuildings, found: Expectation, *, classes: Mapping[str, int]
) -> Shares:
    """Return `said/CLASS` and `true/CLASS`: predicted and true P(another one | one is seen).

    They are over the rooms that show exactly one of the class and hide a part of their objects.

    Args:
        truth: of N nodes.
        masked: what was seen of them.
        found: what a model expects.
        classes: name → index in the class space.
    """
    partly = view_rooms(masked)
    open_ = partly["half-seen"] | partly["glimpsed"]
    shares = {}
    for name, c in classes.items():
        one = open_ & (truth.inputs[:, c] == 1) & ~masked.seen.withheld[:, c]
        cells = one.astype(float)
        shares[f"said/{name}"] = (found.presence[:, c] * cells, cells)
        shares[f"true/{name}"] = ((truth.hidden[:, c] > 0) * cells, cells)
    return shares


def tally_surroundings(truth: Truth, masked: MaskedBuildings, found: Expectation) -> Shares:
    """Return `floor_area` and `labels`: the presence loss of unvisited rooms with that evidence."""
    known = masked.seen.surroundings
    unvisited = view_rooms(masked)["unvisited"]
    has = {"floor_area": np.isfinite(known.floor_area), "labels": known.labels.any(axis=1)}
    return {
        evidence: tally_presence_loss(truth, found, rooms=unvisited & there)
        for evidence, there in has.items()
    }


def tally_presence_loss(truth: Truth, found: Expectation, *, rooms: Bools) -> tuple[Floats, Floats]:
    """Return the log-loss of presence in some rooms `[N]`: what each adds, and its cells."""
    said = np.clip(found.presence, LEAST, 1 - LEAST)
    loss = -np.where(truth.hidden > 0, np.log(said), np.log1p(-said)).sum(axis=1)
    return loss * rooms, truth.inputs.shape[1] * rooms.astype(float)
