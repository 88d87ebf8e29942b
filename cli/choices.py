"""The names that helps list and options take, known without importing what they stand for.

Registries know their names without importing their rows, so that a help does not wait for torch.
The names of worlds and sizes stand in files that import SciPy or trimesh, and stand here again; a
test holds that both are the same.
"""

from __future__ import annotations

from collections.abc import Iterable

import click

from bsg_data import registry
from bsg_data.errors import RecipeError
from bsg_data.observation.masks import MASKS
from bsg_models.search.catalogue import PLANNERS
from bsg_models.zoo.catalogue import ZOO

__all__ = ["MASKS", "PLANNERS"]  # registries: their names are read when they are asked for
MODELS = ZOO
WORLDS = ("star", "complete", "complete-paths", "tree", "tree-plus", "layout", "geometry")
DEFAULT_WORLDS = ("star:1-10", "complete:5-10", "tree:1-10")
MESH_SIZES = ("small", "full")
MOST_SCENES = 10_000_000  # that one seed makes
MOST_ROOMS, MOST_OBJECTS = 100_000, 4_000_000  # of a synthetic building


def require_known(kind: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a name that is not known, with the nearest that is.

    Raises:
        click.UsageError: for the first such name.
    """
    try:
        registry.require_known(kind, names, known)
    except RecipeError as error:
        raise click.UsageError(str(error)) from error
