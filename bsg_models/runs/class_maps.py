"""Choose the class map from a robot's words to a model's classes: published, or the user's own."""

from __future__ import annotations

from pathlib import Path

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import (
    ClassMap,
    OwnMap,
    join_maps,
    load_class_map,
    map_into,
    parse_own_map,
    published_maps,
)
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import CheckpointHeader


def choose_class_map(path: Path, header: CheckpointHeader) -> ClassMap:
    """Return the class map from a robot's words to the classes of a model.

    The user's own maps come first, in the order of the dataset's sources; if two list a word, the
    earlier decides. HM3D's words are added unless every source has a map of the user's own.
    """
    own = [one for one in header.class_maps if isinstance(one, OwnMap)]
    named = [one for one in header.class_maps if isinstance(one, str)]
    space = header.class_space
    try:
        maps = [parse_own_map(one) for one in own]
        if not own or any(name in published_maps() for name in named):
            maps.append(load_class_map(map_into(space.name)))
        joined = join_maps(*maps)
    except ClassMapError as error:
        raise CheckpointError(
            f"{path}: {error}. A checkpoint holds the class map only if its dataset does: "
            "build the dataset again with `bsg-data build`, and train again"
        ) from error
    if joined.space != space:
        raise CheckpointError(
            f"{path}: predicts classes of {space}, and its class map {joined.version} leads into "
            f"{joined.space}; train again"
        )
    return joined
