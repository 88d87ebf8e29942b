"""The names that help texts list and options accept, without slow imports, and configurations.

A registry knows its names without importing its rows, so a help text does not wait for torch. The
modules that define worlds and mesh sizes import SciPy or trimesh. Their names are repeated here,
and a test compares them.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click

import bsg_models
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
    """Refuse an unknown name and suggest the nearest known one."""
    try:
        registry.require_known(kind, names, known)
    except RecipeError as error:
        raise click.UsageError(str(error)) from error


def load_config(name: str, settings: tuple[str, ...] = ()) -> bsg_models.RunConfig:
    """Return the configuration of a zoo name or a TOML file, with its overrides."""
    if name in MODELS or not (name.endswith(".toml") or Path(name).is_file()):
        require_known("model", [name], MODELS)
        tables = bsg_models.find_config(name).model_dump(mode="json")
    else:
        tables = bsg_models.read_config(Path(name))
    source = f"--config {name}" + (" with its --set" if settings else "")
    return bsg_models.validate_config(bsg_models.override(tables, settings), source=source)
