"""All commands of the project, by their installed names."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import click

from bsg_cli import belief, data, evaluate, leaderboard, models, ros, search, serve, train

COMMANDS: Mapping[str, click.Command] = MappingProxyType(
    {
        "bsg-data": data.main,
        "bsg-train": train.main,
        "bsg-evaluate": evaluate.main,
        "bsg-leaderboard": leaderboard.main,
        "bsg-belief": belief.main,
        "bsg-search": search.main,
        "bsg-serve": serve.main,
        "bsg-ros": ros.main,
        "bsg-models": models.main,
    }
)
