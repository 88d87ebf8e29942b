"""Read a recording of Rerun back; tests are skipped where rerun-sdk is not installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rerun", reason="the extra `rerun` is not installed")
try:
    from rerun.chunk import RrdReader
except ImportError:  # rerun-sdk up to 0.38
    from rerun.experimental import RrdReader


def read_recording(path: Path) -> dict[str, list[Any]]:
    """Return `ENTITY COLUMN` → what it holds at each step; static columns have one row."""
    found = {}
    for chunk in RrdReader(path).stream():
        for name, rows in chunk.to_record_batch().to_pydict().items():
            if name == "step":
                assert rows == list(range(len(rows))), "a row for every step"
            elif not name.startswith("rerun.controls"):
                entity = str(chunk.entity_path).lstrip("/").replace("\\", "")
                found[f"{entity} {name.rpartition(':')[2]}"] = rows
    return found


def name_recording(path: Path) -> tuple[str, int]:
    """Return the id of the only recording of a file, and the number of its blueprints."""
    reader = RrdReader(path)
    (recording,) = reader.recordings()
    return recording.recording_id, len(reader.blueprints())
