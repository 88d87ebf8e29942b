"""Run `bsg-data` in this process."""

from __future__ import annotations

from commands import runner

from bsg_cli.data import main

run = runner(main)
