"""What was seen of one building, written out by hand or read from pairs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.schema import pairs_schema
from bsg_data.observation.observation import Observation
from bsg_data.observation.pairs import stream_pairs
from bsg_data.scene.connections import Connections
from bsg_data.scene.room_label import RoomType
from bsg_data.scene.surroundings import EVIDENCE, Surroundings
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.model import ModelInputs


def surround_rooms(
    areas: Sequence[float | None],
    room_types: Sequence[RoomType | None],
    *,
    building_kind: str | None = None,
    source: str | None = None,
) -> Surroundings:
    """Return the surroundings of a building, from what a robot says of its rooms."""
    return Surroundings.of_rooms(areas, room_types, building_kind=building_kind, source=source)


def read_pairs(dataset: Path | Dataset, split: str) -> pa.Table:
    """Read the stored pairs of one split or fold."""
    data = dataset if isinstance(dataset, Dataset) else Dataset.open(dataset)
    empty = pairs_schema(len(data.manifest.class_space.classes)).empty_table()
    return pa.concat_tables([empty, *stream_pairs(data, split)])


def make_zoo_model(name: str, *, classes: int, **settings: Any) -> Any:
    """Return a model of the zoo that has learned nothing, with some settings of its own."""
    row = ZOO[name]
    return row.make(row.config.model_copy(update=settings), ModelInputs(classes=classes))


def same_surroundings(a: Surroundings, b: Surroundings) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True) for name in EVIDENCE
    )


def observe_building(
    inputs: Sequence[Sequence[float]],
    *,
    hidden_share: float | Sequence[float] = 0.5,
    visited: Sequence[bool] | None = None,
    withheld: Sequence[int] = (),
    unclassified: Sequence[Sequence[float]] | None = None,
    vocabulary: tuple[str, ...] = (),
    connected: Sequence[tuple[int, int]] = (),
    scene_id: str = "by hand",
    surroundings: Surroundings | None = None,
) -> Observation:
    """Return an observation of one building.

    Args:
        inputs: `[N, C]` histograms, the building first.
        hidden_share: of every node, or one of each, `[N]`.
        visited: `[N]`; everywhere if it is not said.
        withheld: classes that are withheld in all nodes.
        unclassified: `[N, V]`; nothing if it is not said.
        vocabulary: `[V]`.
        connected: pairs of rooms.
        scene_id: names the building.
        surroundings: of the building; unknown if it is not said.
    """
    histograms = np.array(inputs).astype(np.int64)
    nodes, classes = histograms.shape
    return Observation(
        scene_ids=(scene_id,),
        starts=np.array([0, nodes]),
        inputs=histograms,
        hidden_share=np.broadcast_to(np.array(hidden_share, dtype=np.float32), (nodes,)).copy(),
        visited=np.ones(nodes, dtype=bool) if visited is None else np.array(visited),
        withheld=np.tile(np.isin(np.arange(classes), list(withheld)), (nodes, 1)),
        vocabulary=vocabulary,
        unclassified=(
            np.zeros((nodes, len(vocabulary)), dtype=np.int64)
            if unclassified is None
            else np.array(unclassified, dtype=np.int64).reshape(nodes, len(vocabulary))
        ),
        connections=Connections.of_pairs(connected),
        surroundings=Surroundings.unknown(nodes=nodes) if surroundings is None else surroundings,
    )
