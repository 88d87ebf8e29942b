"""Find the checkpoint that a user means: a folder, a file, a shipped name, or a hub model.

Shipped models are files of the package `bsg_weights`; its `SHA256SUMS` lists them. Only `download`
uses the network: a hub model is found only if it is on this machine already.
"""

from __future__ import annotations

import os
import re
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from bsg_data.errors import RecipeError, ask_to_install
from bsg_data.files import AnyPath, resolve_links
from bsg_data.registry import require_known
from bsg_data.seal import read_seal
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN, show_value
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import BEST, read_fields

DEFAULT_MODEL = "universal"
TERMS = (  # said where nobody named a model: who takes the default has not chosen its licence
    "universal: weights for non-commercial research (NOTICE); for any other use, name the model "
    "open"
)
WIDE_MAP = "hm3d-wide-v1"  # which knows names of things that the default map leaves out
SUFFIX = ".safetensors"
HUB_WEIGHTS, HUB_CONFIG, HUB_CARD = "model.safetensors", "config.json", "README.md"
Kind = Literal["run", "file", "hub folder", "shipped", "hub"]  # how a model was found
_HUB_ID = re.compile(r"[A-Za-z0-9][\w.-]{0,95}/[A-Za-z0-9][\w.-]{0,95}")


@dataclass(frozen=True, slots=True)
class FoundModel:
    """A model that was found."""

    path: Path  # of its checkpoint
    name: str  # of the folder, the file, the shipped model, or the hub model
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
            f"{_describe_shipped()}"
        )
    try:
        return _find_name(model) if isinstance(model, str) else _find_path(Path(model))
    except (OSError, ValueError) as error:  # no file system takes such a name
        reason = getattr(error, "strerror", None) or error
        raise CheckpointError(
            f"no model {os.fspath(model)[:SHOWN]!r}: {reason}; {_describe_shipped()}"
        ) from error


def _find_name(model: str) -> FoundModel:
    path = Path(model)
    if "/" in model or os.sep in model or model.startswith(".") or model.endswith(SUFFIX):
        is_hub = _HUB_ID.fullmatch(model) and not (path.exists() or path.parent.is_dir())
        return _find_downloaded(model) if is_hub else _find_path(path)
    shipped = weights_folder() / f"{model}{SUFFIX}"  # what is read is checked by its hash
    if shipped.is_file():
        return FoundModel(shipped, model, "shipped")
    if model and path.is_dir():
        return _find_path(path)
    hint = f"{ask_if_meant(model, shipped_names())} {_describe_shipped()}".lstrip()
    raise CheckpointError(
        f"no model {model[:SHOWN]!r}: no folder here and no shipped model has this name; {hint}"
    )


def _find_path(path: Path) -> FoundModel:
    if path.is_file():
        return FoundModel(path, path.stem, "file")
    if not path.exists():
        raise CheckpointError(
            f"{path}: there is no such file or folder: expected a run, which `bsg-train` writes, "
            f"or a checkpoint; {_describe_shipped()}"
        )
    name = path.name or resolve_links(path).name
    kinds: tuple[tuple[str, Kind], ...] = ((BEST, "run"), (HUB_WEIGHTS, "hub folder"))
    for file, kind in kinds:
        if (path / file).exists():
            return FoundModel(path / file, name, kind)
    raise CheckpointError(
        f"{path}: no checkpoint there: expected a file, or a folder with {BEST}, which `bsg-train` "
        f"writes, or {HUB_WEIGHTS} of a hub model; {_describe_shipped()}"
    )


def locate_run(model: AnyPath) -> Path:
    """Return the folder of a run, or the checkpoint of a model without a run folder.

    Raises:
        CheckpointError: if there is no such model.
    """
    found = find_model(model)
    return found.path.parent if found.kind == "run" else found.path


def name_run(run: Path) -> str:
    """Return the name of a run for people: a shipped model's name, else the path."""
    is_shipped = run.parent == weights_folder() and run.suffix == SUFFIX
    return run.stem if is_shipped else str(run)


def weights_folder() -> Path:
    """Return the folder of the package `bsg_weights`."""
    return Path(str(files("bsg_weights")))


def shipped_names() -> tuple[str, ...]:
    """Return the names of the shipped models, in the order of `SHA256SUMS`.

    Raises:
        DatasetError: if the list is damaged.
    """
    names = (name for name in read_seal(weights_folder()) or () if name.endswith(SUFFIX))
    return tuple(name.removesuffix(SUFFIX) for name in names)


def find_shipped(name: str, *, suffix: str = SUFFIX) -> Path:
    """Return a file of a shipped model, its checkpoint or its card."""
    require_known("shipped model", [name], shipped_names())
    return weights_folder() / f"{name}{suffix}"


def read_shipped_card(name: str) -> str:
    """Return the card of a shipped model."""
    return find_shipped(name, suffix=".md").read_text("utf-8")


def _describe_shipped() -> str:
    """Return which models are shipped, as the end of an error message."""
    names = ", ".join(shipped_names())
    return f"shipped models are {names}" if names else "no models are shipped with this build"


def download(name: str, **options: Any) -> Path:
    """Return the checkpoint of a hub model; download it and its card if they are not here.

    Args:
        name: `OWNER/NAME`.
        options: of `hf_hub_download`, such as `revision`, `cache_dir` and `local_files_only`.

    Raises:
        CheckpointError: if it cannot be downloaded, or is no checkpoint.
    """
    if not _HUB_ID.fullmatch(name):
        raise CheckpointError(f"{name!r} is no OWNER/NAME of a model of the hub")
    path = _fetch(name, HUB_WEIGHTS, **options)
    with suppress(CheckpointError):  # the card is optional
        _fetch(name, HUB_CARD, **options)
    read_fields(path)
    return path


def _find_downloaded(name: str) -> FoundModel:
    """Return a hub model that was downloaded before."""
    try:
        return FoundModel(_fetch(name, HUB_WEIGHTS, local_files_only=True), name, "hub")
    except CheckpointError as error:
        raise CheckpointError(
            f"{name}: there is no such file or folder; {_describe_shipped()}. If it is a model of "
            f"the hub, `bsg-models download {name}` fetches it"
        ) from error


def _fetch(name: str, file: str, **options: Any) -> Path:
    """Return a file of a hub model, as `hf_hub_download` finds it."""
    try:
        import huggingface_hub as hub
    except ImportError as error:
        raise CheckpointError(
            f"{name}: a model of the hub needs huggingface-hub: {ask_to_install('hub')}"
        ) from error
    try:
        return Path(hub.hf_hub_download(name, file, **options))
    except (hub.errors.HFValidationError, hub.errors.HfHubHTTPError, OSError) as error:
        why = " ".join(str(error).split())[:300]
        raise CheckpointError(f"{name}: cannot be had from the hub ({why})") from error
