"""Find the checkpoint that a user means: a folder, a file, a shipped name, or a hub model.

Nothing here uses the network. A hub model is found only if it is on this machine already;
`bsg-models download` fetches it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.spelling import SHOWN, show_value
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.hub_files import HUB_ID, HUB_WEIGHTS, find_downloaded
from bsg_models.runs.run_folder import BEST
from bsg_models.runs.shipped import (
    SUFFIX,
    Kind,
    describe_shipped,
    find_shipped,
    shipped_names,
    suggest_shipped,
)


@dataclass(frozen=True, slots=True)
class FoundModel:
    """A model that was found.

    Attributes:
        path: of its checkpoint.
        name: of the folder, the file, the shipped model, or the hub model.
        kind: how it was found.
    """

    path: Path
    name: str
    kind: Kind


def find_model(model: AnyPath) -> FoundModel:
    """Return the checkpoint of a model.

    A path object is taken as a path. Text is tried, in this order, as: an existing path, if it
    looks like one (it has a separator, begins with a full stop or ends with `.safetensors`); the
    name of a shipped model; a folder of that name; the id `OWNER/NAME` of a downloaded hub model.

    Raises:
        CheckpointError: if there is no such model; the message lists what was tried and the names
            that exist.
        RecipeError: if it is neither text nor a path.
    """
    if not isinstance(model, (str, os.PathLike)):
        raise RecipeError(
            f"model: expected a path or the name of a model, found {show_value(model)}; "
            f"{describe_shipped()}"
        )
    try:
        return _find(model if isinstance(model, str) else Path(model))
    except (OSError, ValueError) as error:  # no file system takes such a name
        said = getattr(error, "strerror", None) or error
        raise CheckpointError(
            f"no model {os.fspath(model)[:SHOWN]!r}: {said}; {describe_shipped()}"
        ) from error


def _find(model: Path | str) -> FoundModel:
    if isinstance(model, Path):
        return _find_path(model)
    path = Path(model)
    if _looks_like_path(model):
        if path.exists() or not HUB_ID.fullmatch(model):
            return _find_path(path)
        return _find_hub(model)
    if model in shipped_names():
        return FoundModel(find_shipped(model), model, "shipped")
    if model and path.is_dir():
        return _find_path(path)
    raise CheckpointError(
        f"no model {model[:SHOWN]!r}: no folder here and no shipped model has this name; "
        f"{suggest_shipped(model)}"
    )


def locate_run(model: AnyPath) -> Path:
    """Return the folder of a run, or the checkpoint of a model without a run folder.

    Raises:
        CheckpointError: if there is no such model.
    """
    found = find_model(model)
    return found.path.parent if found.kind == "run" else found.path


def name_model(found: FoundModel, header: CheckpointHeader) -> str:
    """Return the name of a model for people: a shipped one's own name, else that in the zoo."""
    return found.name if found.kind == "shipped" else header.config.name


def _looks_like_path(text: str) -> bool:
    return os.sep in text or "/" in text or text.startswith(".") or text.endswith(SUFFIX)


def _find_path(path: Path) -> FoundModel:
    if path.is_dir():
        name = path.name or resolve_links(path).name
        if (path / BEST).exists():
            return FoundModel(path / BEST, name, "run")
        if (path / HUB_WEIGHTS).exists():
            return FoundModel(path / HUB_WEIGHTS, name, "hub folder")
        raise CheckpointError(
            f"{path}: no checkpoint there: expected {BEST}, which `bsg-train` writes, or "
            f"{HUB_WEIGHTS} of a hub model; {describe_shipped()}"
        )
    if path.is_file():
        return FoundModel(path, path.stem, "file")
    raise CheckpointError(
        f"{path}: no checkpoint there: no such folder or file; train one with `bsg-train`, or "
        f"name a model: {describe_shipped()}"
    )


def _find_hub(name: str) -> FoundModel:
    """Return a hub model that was downloaded before."""
    path = find_downloaded(name)
    if path is None:
        raise CheckpointError(
            f"{name}: neither a folder nor a downloaded hub model; fetch one with `bsg-models "
            f"download {name}`. On this machine, {describe_shipped()}"
        )
    return FoundModel(path, name, "hub")
