"""Belief graphs in JSON: `bsg_models.belief.document`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bsg_data.dataset.manifest import ClassSpaceEntry
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.class_space import hash_classes
from bsg_data.scene.scene_graph import Box
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.document import encode_belief
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.belief.formats import read_belief
from fuzz.target import Target, encode, load_map, put

CLASSES = ("bed", "chair")


def make_belief(rooms: tuple[str, ...], *, published: bool = False) -> BeliefGraph:
    """Return a belief graph of some rooms, over two classes or over those that are published."""
    small = ClassSpaceEntry(name="two", sha256=hash_classes(CLASSES), classes=CLASSES)
    space = ClassSpaceEntry.of(load_class_map().space) if published else small
    known = tuple(
        KnownRoom(
            name,
            hidden_share=0.5,
            visited=number == 0,
            label="kitchen",
            position=(1.0, 2.0, 0.5),
            box=Box((0.0, 0.0, 0.0), (1.0, 1.0, 2.0)),
            footprint=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)),
            floor_index=number,
            floor_area=9.5,
            room_type={"kitchen": 0.5, "bar": 0.25},
            hidden_share_sd=0.125,
        )
        for number, name in enumerate(rooms)
    )
    index = space.classes.index("chair")
    objects = (SeenObject("o", 1, "chair", "chair", index, (1.0, 1.0, 1.0)),)
    graph = PartialGraph("s", space, 0.5, known, objects, ((1, 2),), building_kind="home")
    inputs = graph.histograms().astype(float)
    hidden = from_hidden_counts(inputs, poisson(np.full(inputs.shape, 0.75)))
    return believe(graph, hidden, mode="complete", model="m")


def seeds() -> dict[str, bytes]:
    """Return a belief graph over two classes, and one over those that are published."""
    return {
        "two": encode(encode_belief(make_belief(("kitchen", "hall")))),
        "published": encode(encode_belief(make_belief(("kitchen", "hall"), published=True))),
    }


def read(folder: Path, data: bytes) -> object:
    """Read a file."""
    load_map()
    return read_belief(put(folder, ".json", data))


TARGET = Target(
    name="belief-json",
    read=read,
    seeds=seeds,
    words=("class_map", "class_space", "version", "blind", "partial", "hm3d45-v1", "hm3d45-v2"),
    most=12_000,
)
