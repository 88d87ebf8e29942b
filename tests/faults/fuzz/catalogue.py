"""All readers that are fuzzed, by their names; a row is imported when it is asked for."""

from __future__ import annotations

import importlib

from fuzz.target import Target

ROWS = {
    "annotation": "fuzz.annotation",
    "configuration": "fuzz.configuration",
    "robot-json": "fuzz.robot_json",
}


def find_target(name: str) -> Target:
    """Return a target by its name."""
    target = importlib.import_module(ROWS[name]).TARGET
    assert isinstance(target, Target)
    return target
