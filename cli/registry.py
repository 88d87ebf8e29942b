"""All commands of the project, by their installed names."""

from __future__ import annotations

from collections.abc import Mapping

import click

from bsg_cli import belief, data, evaluate, leaderboard, models, ros, search, serve, train

_ROOMS = (data, train, evaluate, leaderboard, belief, search, serve, ros, models)
COMMANDS: Mapping[str, click.Command] = {str(room.main.name): room.main for room in _ROOMS}
