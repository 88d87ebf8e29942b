"""Load the configuration that a command names: a model of the zoo or a TOML file."""

from __future__ import annotations

from pathlib import Path

import bsg_models
from bsg_cli.choices import MODELS, require_known


def load_config(name: str, settings: tuple[str, ...] = ()) -> bsg_models.RunConfig:
    """Return the configuration of a zoo name or a TOML file, with its overrides.

    Raises:
        click.UsageError: if the name is neither.
        ConfigError: if the file or an override is invalid.
    """
    if name in MODELS or not (name.endswith(".toml") or Path(name).is_file()):
        require_known("model", [name], MODELS)
        tables = bsg_models.find_config(name).model_dump(mode="json")
    else:
        tables = bsg_models.read_config(Path(name))
    source = f"--config {name}" + (" with its --set" if settings else "")
    return bsg_models.validate_config(bsg_models.override(tables, settings), source=source)
