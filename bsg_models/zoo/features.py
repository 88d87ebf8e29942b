"""Turn a node into a network's features: its histogram, its mask, its building, its surroundings.

Every feature is of order one, whatever the size of a room or a building.

`LabelPrior` is common sense about room labels. Few buildings have a laundry room, and a table
written by hand knows what one holds (`bsg_models.zoo.hand_prior`). It changes the odds that a
room holds any of class c, and not how many it holds if it does:

    log odds of at least one  +=  f · trust_c · (logit P(c | label) − logit P(c | any room))

f is the share that the room hides: where a robot has looked, objects say more than the label. The
network learns how far to trust the table, and what it knows better of labels that occur often.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field, field_validator

from bsg_data.arrays import Floats
from bsg_data.scene.room_label import list_room_labels
from bsg_models.arrays import Array, floats, library_of
from bsg_models.inputs.nodes import EVIDENCE, Nodes, sum_buildings
from bsg_models.zoo.hand_prior import read_hand_prior
from bsg_models.zoo.layers import (
    NO_DROPOUT,
    NoDropout,
    Weight,
    Weights,
    linear,
    linear_weights,
    logit,
)
from bsg_models.zoo.settings import ModelConfig

_SILENT_ROOMS = 3.0  # without anything, added to the others: one room says little of the next
_TRUST = 0.5  # in the table, at the start
_EMBEDDING = "features.embedding"
_EDGE = 0.02  # shares are moved this far from 0 and 1 before a logarithm

EVERYTHING = ("mask", "building", "categories", "withheld", *EVIDENCE)


class NetworkConfig(ModelConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"
    width: int = Field(default=128, ge=1, le=4096)  # channels of the hidden layers
    depth: int = Field(default=2, ge=1, le=64)  # rounds or layers
    # Share of channels dropped after each layer; half of it for the features.
    dropout: float = Field(default=0.4, ge=0.0, lt=1.0)
    tilted: int = Field(default=2, ge=0, le=8)  # J, first counts with a tilted prior
    components: int = Field(default=2, ge=1, le=16)  # K, of the mixture that a count follows
    # Evidence besides the node's own histogram; see `NodeFeatures`.
    reads: tuple[str, ...] = ("mask", "building", "categories")
    # Width of the embedding of the categories outside the classes, learned with the network.
    embedding: int = Field(default=32, ge=1, le=4096)
    # Share of these categories that training overlooks.
    category_dropout: float = Field(default=0.3, ge=0.0, lt=1.0)
    # Share of the rooms whose `EVIDENCE` training hides, so that the network never depends on it.
    forget: float = Field(default=0.5, ge=0.0, lt=1.0)
    calibrate: bool = True  # fit the calibration on the val buildings

    @field_validator("reads")
    @classmethod
    def _evidence_exists(cls, reads: tuple[str, ...]) -> tuple[str, ...]:
        unknown = [name for name in reads if name not in EVERYTHING]
        if unknown:
            raise ValueError(f"reads must be of {', '.join(EVERYTHING)}; found {unknown[0]!r}")
        return reads


class NodeFeatures:
    """Turn nodes into features `[N, F]`.

    The node's own histogram is always included: log(1 + count), presence and log(1 + total). The
    configuration (`reads`) adds:

    - `mask`: the share that the node hides, as log-odds, and whether it was visited; without them
      an empty node looks like one that nobody looked into.
    - `withheld`: whether each class is withheld, so that its absence is no evidence.
    - `categories`: an embedding of the set of visible categories outside the classes, of the node
      and averaged over the other visited rooms; training drops single categories at random.
    - `building`: log(1 + count) of the building, the share of the other visited rooms in which each
      class was seen, the logarithm of the number of rooms, and the kind of node.
    - the rows of `bsg_models.inputs.nodes.EVIDENCE`: what is known of the room and the building.
    """

    def __init__(self, config: NetworkConfig, classes: int, vocabulary: int) -> None:
        self.reads = frozenset(config.reads)
        if not vocabulary:  # no category is frequent enough
            self.reads -= {"categories"}
        self.share_forgotten, self.category_dropout = config.forget, config.category_dropout
        self.weights: dict[str, Weight] = {}
        first = 2 * classes + 1
        mask = 2 * ("mask" in self.reads) + classes * ("withheld" in self.reads)
        self.width = first + mask
        if "building" in self.reads:
            self.width += 2 * classes + 2
        if "categories" in self.reads:
            self.weights = linear_weights(_EMBEDDING, vocabulary, config.embedding, bias=False)
            self.width += config.embedding * (2 if "building" in self.reads else 1)
        # columns that dropout leaves: a dropped one would say that nothing is hidden, or a home
        self.spared = [slice(first, first + mask)]
        for name, evidence in EVIDENCE.items():
            if name in self.reads:
                columns = slice(self.width, self.width + evidence.width())
                self.width = columns.stop
                self.spared += [columns] if evidence.of_building else []

    def __call__(self, weights: Weights, nodes: Nodes, drop: NoDropout = NO_DROPOUT) -> Array:
        """Return features `[N, F]`; what trainings drop of them is `drop`."""
        xp = library_of(nodes.x)
        seen = floats(nodes.x > 0)
        parts = [xp.log1p(nodes.x), seen, xp.log1p(nodes.x.sum(axis=1, keepdims=True))]
        if "mask" in self.reads:
            share = nodes.hidden_share.clip(_EDGE, 1 - _EDGE)
            parts += [(logit(share) / 2)[:, None], floats(nodes.visited)[:, None]]
        looked_for = floats(nodes.share < 1)
        if "withheld" in self.reads:
            parts.append(1 - looked_for)
        shown = [seen]
        if "categories" in self.reads:
            present = drop.entries(floats(nodes.unclassified > 0), self.category_dropout)
            shown.append(linear(weights, _EMBEDDING, present))
            parts.append(shown[-1])
        if "building" in self.reads:
            looked = [looked_for, *map(xp.ones_like, shown[1:])]
            parts += _look_around(
                nodes, xp.concatenate(shown, axis=1), xp.concatenate(looked, axis=1)
            )
        parts += [nodes.evidence[name] for name in EVIDENCE if name in self.reads]
        return xp.concatenate(parts, axis=1)

    def forget(self, nodes: Nodes, drop: NoDropout) -> Nodes:
        """Return nodes whose `EVIDENCE` of a share of the rooms a training hides."""
        evidence = dict(nodes.evidence)
        for name in (name for name in EVIDENCE if name in self.reads):
            if not EVIDENCE[name].of_building:  # without it, a building is taken for a home
                evidence[name] = drop.rows(evidence[name], self.share_forgotten)
        return replace(nodes, evidence=evidence)


def _look_around(nodes: Nodes, shown: Array, looked_for: Array) -> list[Array]:
    """Return what is around each node.

    These are the building's counts `[N, C]`, the shrunk mean of `shown` `[N, S]` over the other
    visited rooms that could show it (`looked_for`), the number of rooms, and whether it is a
    building.
    """
    xp, building = library_of(nodes.x), nodes.building
    visited = floats(nodes.visited & ~nodes.is_building)[:, None] * looked_for
    others = sum_buildings(visited, nodes)[building] - visited
    siblings = sum_buildings(shown * visited, nodes)[building] - shown * visited
    rooms = sum_buildings(floats(~nodes.is_building)[:, None], nodes)
    return [
        xp.log1p(nodes.x[nodes.first])[building],
        siblings / (others + _SILENT_ROOMS),
        xp.log1p(rooms)[building],
        floats(nodes.is_building)[:, None],
    ]


class LabelPrior:
    """What common sense adds to the log odds of a class in a room with a label."""

    def __init__(self, classes: int) -> None:
        self.weights = {
            "labels.log_odds": Weight((len(list_room_labels()), classes), learned=False),
            "labels.trust": Weight((classes,), value=_TRUST),
        }

    def __call__(self, weights: Weights, labels: Array) -> Array:
        """Return what f = 1 adds `[N, C]`, given P(label) `[N, L]`; 0 where it is unknown."""
        return labels @ weights["labels.log_odds"] * weights["labels.trust"]


def tabulate_labels(classes: tuple[str, ...]) -> Floats:
    """Return the log odds of the shipped table minus those of any room, `[L, C]`.

    They are 0 for labels that it does not list.
    """
    table = read_hand_prior(classes)
    usual = table.usual[:, None]
    any_room = logit(table.usual @ table.presence)
    return np.where(usual > 0, logit(table.presence) - any_room, 0.0)
