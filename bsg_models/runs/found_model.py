"""From what a user says to a checkpoint: a folder, a file, a shipped name, or a model of the hub.

Nothing here uses a network: of the hub only what is on this machine already is found, and
`bsg-models download` brings the rest.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bsg_data.spelling import SHOWN
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.hub_files import HUB_ID, HUB_WEIGHTS, find_downloaded
from bsg_models.runs.run_folder import BEST
from bsg_models.runs.shipped import (
    SUFFIX,
    describe_shipped,
    find_shipped,
    shipped_names,
    suggest_shipped,
)

Kind = Literal["run", "file", "hub folder", "shipped", "hub"]


@dataclass(frozen=True, slots=True)
class FoundModel:
    """A model that was asked for.

    Attributes:
        path: of its checkpoint.
        name: to tell it by: of the folder, the file, the shipped model, or on the hub.
        kind: how it was found.
    """

    path: Path
    name: str
    kind: Kind


def find_model(model: Path | str) -> FoundModel:
    """Return the checkpoint of a model.

    A `Path` is one. Text is, in this order: a path that is there, if it looks like one (it has a
    separator, begins with a full stop or ends with `.safetensors`); the name of a shipped model; a
    folder of that name; the id `OWNER/NAME` of a model of the hub that was downloaded.

    Raises:
        CheckpointError: if there is no such model, with what was looked for and the names that
            there are.
    """
    try:
        return _find(model)
    except (OSError, ValueError) as error:  # a name that no file system takes
        said = getattr(error, "strerror", None) or error
        raise CheckpointError(
            f"no model {str(model)[:SHOWN]!r}: {said}; {describe_shipped()}"
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
        f"no model {model[:SHOWN]!r}: it is no folder here, and none of this name is shipped; "
        f"{suggest_shipped(model)}"
    )


def locate_run(model: Path | str) -> Path:
    """Return the folder of a run, or the checkpoint of a model that is none.

    Raises:
        CheckpointError: if there is no such model.
    """
    found = find_model(model)
    return found.path.parent if found.kind == "run" else found.path


def name_model(found: FoundModel, header: CheckpointHeader) -> str:
    """Return how people name a model: a shipped one by its own name, another by that in the zoo."""
    return found.name if found.kind == "shipped" else header.config.name


def _looks_like_path(text: str) -> bool:
    return os.sep in text or "/" in text or text.startswith(".") or text.endswith(SUFFIX)


def _find_path(path: Path) -> FoundModel:
    if path.is_dir():
        name = path.name or path.resolve().name
        if (path / BEST).exists():
            return FoundModel(path / BEST, name, "run")
        if (path / HUB_WEIGHTS).exists():
            return FoundModel(path / HUB_WEIGHTS, name, "hub folder")
        raise CheckpointError(
            f"{path}: no checkpoint there: looked for {BEST}, which `bsg-train` leaves, and "
            f"{HUB_WEIGHTS}, of a model of the hub; {describe_shipped()}"
        )
    if path.is_file():
        return FoundModel(path, path.stem, "file")
    raise CheckpointError(
        f"{path}: no checkpoint there: no such folder or file; train one with `bsg-train`, or "
        f"name a model: {describe_shipped()}"
    )


def _find_hub(name: str) -> FoundModel:
    """Return a model of the hub that was downloaded before."""
    path = find_downloaded(name)
    if path is None:
        raise CheckpointError(
            f"{name}: no such folder, and no model of the hub that was downloaded; `bsg-models "
            f"download {name}` fetches one. Of this machine, {describe_shipped()}"
        )
    return FoundModel(path, name, "hub")
