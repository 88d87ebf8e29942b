"""The names that helps list are those of the library."""

from __future__ import annotations

from typing import get_args

import click
import pytest

from bsg_cli import choices
from bsg_data.observation.masks import MASKS
from bsg_data.synthetic.building_size import MOST_OBJECTS, MOST_ROOMS
from bsg_data.synthetic.buildings import MAX_SCENES
from bsg_data.synthetic.meshes import SIZES
from bsg_models.search import room_graphs
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO


def test_names_are_those_of_the_library() -> None:
    for names, registry in (
        (choices.MODELS, ZOO),
        (choices.PLANNERS, PLANNERS),
        (choices.MASKS, MASKS),
    ):
        assert tuple(names) == registry.names()
        assert all(registry[name] for name in names)
    assert get_args(room_graphs.WorldKind) == choices.WORLDS
    assert tuple(world.name for world in room_graphs.DEFAULT_WORLDS) == choices.DEFAULT_WORLDS
    assert tuple(SIZES) == choices.MESH_SIZES
    assert choices.MOST_SCENES == MAX_SCENES
    assert (choices.MOST_ROOMS, choices.MOST_OBJECTS) == (MOST_ROOMS, MOST_OBJECTS)


def test_an_unknown_name_is_refused_with_the_nearest() -> None:
    choices.require_known("planner", ["ratio"], choices.PLANNERS)
    with pytest.raises(click.UsageError, match=r"no planner 'rtaio'; did you mean ratio\?"):
        choices.require_known("planner", ["ratio", "rtaio"], choices.PLANNERS)
