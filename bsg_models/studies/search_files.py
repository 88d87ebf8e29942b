"""Write a search study: one parquet row per search, and its results as JSON."""

from __future__ import annotations

import io
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.files import write_bytes
from bsg_models.studies.savings import WorldResult
from bsg_models.studies.search_study import Study

SEARCHES = pa.schema(
    [
        pa.field("scene_id", pa.string(), nullable=False),
        pa.field("world", pa.string(), nullable=False),
        pa.field("task", pa.string(), nullable=False),
        pa.field("planner", pa.string(), nullable=False),
        pa.field("episode", pa.int32(), nullable=False),
        pa.field("artifacts", pa.list_(pa.string()), nullable=False),
        pa.field("start_room_index", pa.int32(), nullable=False),
        pa.field("draw", pa.int32(), nullable=False),
        pa.field("instances", pa.int32(), nullable=False),
        pa.field("cost", pa.float64(), nullable=False),
        pa.field("rooms_entered", pa.int32(), nullable=False),
        pa.field("missed", pa.int32(), nullable=False),
    ]
)


def write_searches(study: Study, classes: tuple[str, ...], path: Path) -> None:
    """Write every search of every planner. A failed write leaves no partial file."""
    names = np.array(classes, dtype=object)
    buffer = io.BytesIO()
    with pq.ParquetWriter(buffer, SEARCHES, compression="zstd") as writer:
        for one in study.searches:
            number = len(one.starts)
            for (task, planner), outcome in one.outcomes.items():
                columns = [
                    pa.array([one.scene_id] * number),
                    pa.array([one.world] * number),
                    pa.array([task] * number),
                    pa.array([planner] * number),
                    pa.array(np.arange(number), pa.int32()),
                    pa.array(names[one.artifacts].tolist(), pa.list_(pa.string())),
                    pa.array(one.starts, pa.int32()),
                    pa.array(one.draws, pa.int32()),
                    pa.array(one.instances, pa.int32()),
                    pa.array(outcome.costs),
                    pa.array(outcome.entered, pa.int32()),
                    pa.array(outcome.missed, pa.int32()),
                ]
                writer.write_batch(pa.record_batch(columns, schema=SEARCHES))
    write_bytes(path, buffer.getvalue())


def encode_study(
    study: Study,
    results: list[WorldResult],
    *,
    classes: tuple[str, ...],
    facts: dict[str, Any],
) -> dict[str, Any]:
    """Return a study as JSON: facts, recipe and results; unknown values are null."""
    recipe = study.recipe.model_dump(mode="json")
    recipe["worlds"] = [world.name for world in study.recipe.worlds]
    chosen = study.recipe.artifacts
    recipe["artifacts"] = list(classes) if chosen is None else [classes[c] for c in chosen]
    return {
        **facts,
        "scenes": list(study.scenes),
        "recipe": recipe,
        "left_out": study.left_out,
        "standings": [_plain(asdict(one)) for one in results],
    }


def _plain(value: Any) -> Any:
    """Return nested records for JSON: an estimate becomes value and interval, unknown null."""
    if isinstance(value, dict):
        if "nodes" in value and "value" in value:
            if np.isnan(value["value"]):
                return None
            value = {end: value[end] for end in ("value", "low", "high")}
        return {key: _plain(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and np.isnan(value) else value
