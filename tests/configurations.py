"""Configurations of the zoo with other settings."""

from __future__ import annotations

from bsg_models.zoo.config import RunConfig, find_config, override, validate_config


def configure(name: str, *settings: str) -> RunConfig:
    """Return the configuration of a name, with settings as `--set` takes them."""
    tables = find_config(name).model_dump(mode="json")
    return validate_config(override(tables, settings), source="test")
