"""Belief graphs drawn at random, with hostile names and geometry in some rooms alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import (
    Custom,
    KnownRoom,
    Look,
    PartialGraph,
    Remembered,
    SeenObject,
    Sighting,
)

LOADED = load_class_map()
CLASS_SPACE = LOADED.space
HOSTILE = '</script><img src=x onerror="alert(1)">'


ROOM_TYPES = (None, "kitchen", {"kitchen": 0.1, "bar": 0.25})


def make_belief(seed: int, *, mode: Any = "complete", scene_id: str = "s") -> BeliefGraph:
    """Return a belief graph of random rooms, some with and some without geometry."""
    rng, around = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    rooms = []
    for number in range(int(rng.integers(1, 5))):
        low = tuple(float(v) for v in rng.uniform(-5, 5, 3))
        high = tuple(v + 2.5 for v in low)
        outline = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]))
        placed = rng.random() < 0.5
        rooms.append(
            KnownRoom(
                f"r{number}",
                float(rng.random()),
                bool(rng.random() < 0.7),
                HOSTILE if rng.random() < 0.3 else None,
                low if placed else None,  # type: ignore[arg-type]
                Box(low, high) if placed else None,  # type: ignore[arg-type]
                outline if placed else None,
                int(rng.integers(3)) if placed else None,
                float(around.uniform(1, 50)) if around.random() < 0.5 else None,
                ROOM_TYPES[int(around.integers(3))],
            )
        )
        most = float(np.sqrt(rooms[-1].hidden_share * (1 - rooms[-1].hidden_share)))
        if around.random() < 0.5:
            rooms[-1] = replace(rooms[-1], hidden_share_sd=float(around.uniform(0, 0.99)) * most)
    objects = []
    for number in range(int(rng.integers(0, 9))):
        name = str(rng.choice(["bed", "sofa", "tap", "zzqx", HOSTILE]))
        spot = (1.0, 2.0, float(number)) if rng.random() < 0.5 else None
        room = int(rng.integers(0, len(rooms) + 1))
        known = LOADED.classify(name)
        seen = SeenObject(str(number), room, name, known.category, known.class_index, spot)
        objects.append(seen)
    pairs = [(a, a + 1) for a in range(1, len(rooms)) if rng.random() < 0.6]
    graph = PartialGraph(
        *(scene_id, CLASS_SPACE, 0.25, tuple(rooms), tuple(objects), tuple(pairs)),
        building_kind="hotel" if around.random() < 0.5 else None,
        source=HOSTILE if around.random() < 0.5 else None,
    )
    if around.random() < 0.5:
        graph = _live_in(graph, around)
    inputs = graph.histograms().astype(float)
    expectation = Expectation(inputs, poisson(rng.gamma(0.1, 1.0, inputs.shape)))
    return believe(graph, expectation, mode=mode, model="random")


def _live_in(graph: PartialGraph, rng: np.random.Generator) -> PartialGraph:
    """Return the graph with times, by dates or by a clock of its own, and what a home teaches."""
    first = float(rng.choice([0.0, 1.7e9]))

    def time() -> float:
        return round(first + float(rng.uniform(0, 1e6)), 6)

    def sightings(number: int) -> tuple[Sighting, ...]:
        times = sorted(time() for _ in range(number))
        return tuple(Sighting(one, int(rng.integers(0, 2)), "0") for one in times)

    return replace(
        graph,
        now=first + 1e6,
        rooms=tuple(replace(room, time=time() if room.visited else None) for room in graph.rooms),
        objects=tuple(replace(one, time=time(), score=0.9, stays=5.5) for one in graph.objects),
        looks=(Look(1, "cup", 0.5, time=time()), Look(1, "milk", 0.5)),
        memory=tuple(Remembered(name, HOSTILE, sightings(3)) for name in ("0", "gone")),
        customs=(Custom("drinks", 1), Custom("cola", None, "sofa", never=True)),
    )
