"""The names that help texts list and options accept, without slow imports.

A registry knows its names without importing its rows, so a help text does not wait for torch. The
modules that define worlds and mesh sizes import SciPy or trimesh. Their names are repeated here,
and a test compares them.
"""

from __future__ import annotations

from collections.abc import Iterable

import click

from bsg_data import registry
from bsg_data.errors import RecipeError
from bsg_data.observation.masks import MASKS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO

__all__ = ["MASKS", "PLANNERS"]  # registries: they read their names on first use
MODELS = ZOO
WORLDS = ("star", "complete", "complete-paths", "tree", "tree-plus", "layout", "geometry")
DEFAULT_WORLDS = ("star:1-10", "complete:5-10", "tree:1-10")
MESH_SIZES = ("small", "full")
MOST_SCENES = 10_000_000  # of one seed
MOST_ROOMS, MOST_OBJECTS = 100_000, 4_000_000  # of a synthetic building


def require_known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Refuse an unknown name and suggest the nearest known one.

    Raises:
        click.UsageError: for the first unknown name.
    """
    try:
        registry.require_known(kind, names, known)
    except RecipeError as error:
        raise click.UsageError(str(error)) from error
