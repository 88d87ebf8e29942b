"""Rows of predictions for tests: two classes in one room."""

from __future__ import annotations

from typing import Any

import pandas as pd


def rows(**more: list[Any]) -> pd.DataFrame:
    """Return two rows with other values in some columns."""
    columns = {
        "scene_id": ["a", "a"],
        "draw": [0, 0],
        "node_index": [1, 1],
        "class": ["chair", "bed"],
        "presence": [0.5, 0.25],
        "expected": [0.75, 0.25],
    }
    return pd.DataFrame({**columns, **more})
