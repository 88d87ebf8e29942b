"""Download the files of a Hugging Face hub model, and find them on this machine."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from bsg_data.errors import ask_to_install
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import load_checkpoint

HUB_WEIGHTS, HUB_CONFIG, HUB_CARD = "model.safetensors", "config.json", "README.md"
HUB_ID = re.compile(r"[A-Za-z0-9][\w.-]{0,95}/[A-Za-z0-9][\w.-]{0,95}")


def download(name: str, **options: Any) -> Path:
    """Return the checkpoint of a hub model; download it and its card if they are not here.

    Args:
        name: `OWNER/NAME`.
        options: of `hf_hub_download`, such as `revision`, `cache_dir` and `local_files_only`.

    Raises:
        CheckpointError: if it cannot be downloaded, or is damaged.
    """
    library = _library(name)
    if not HUB_ID.fullmatch(name):
        raise CheckpointError(f"{name!r} is no OWNER/NAME of a model of the hub")
    try:
        path = Path(library.hf_hub_download(name, HUB_WEIGHTS, **options))
    except _refusals(library) as error:
        why = " ".join(str(error).split())[:300]
        raise CheckpointError(f"{name}: cannot be had from the hub ({why})") from error
    try:
        library.hf_hub_download(name, HUB_CARD, **options)
    except _refusals(library):
        pass  # the card is optional
    load_checkpoint(path)
    return path


def find_downloaded(name: str) -> Path | None:
    """Return the checkpoint of a hub model if it is on this machine, without using the network."""
    library = _library(name)
    try:
        return Path(library.hf_hub_download(name, HUB_WEIGHTS, local_files_only=True))
    except _refusals(library):
        return None


def _library(name: str) -> Any:
    try:
        import huggingface_hub
    except ImportError as error:
        raise CheckpointError(
            f"{name}: no such folder; as a model of the hub it needs huggingface-hub: "
            f"{ask_to_install('hub')}"
        ) from error
    return huggingface_hub


def _refusals(library: Any) -> tuple[type[Exception], ...]:
    errors = library.errors
    return (
        errors.HFValidationError,
        errors.HfHubHTTPError,
        errors.LocalEntryNotFoundError,
        OSError,
    )
