"""All readers that are fuzzed, by their names; a row is imported when it is asked for."""

from __future__ import annotations

import importlib

from fuzz.target import Target

ROWS = {
    "annotation": "fuzz.annotation",
    "behavior": "fuzz.behavior",
    "belief-json": "fuzz.belief_json",
    "checkpoint": "fuzz.checkpoint",
    "class-map": "fuzz.class_map",
    "configuration": "fuzz.configuration",
    "house": "fuzz.house",
    "label-space": "fuzz.label_space",
    "layout": "fuzz.layout",
    "mesh": "fuzz.mesh",
    "object-parquet": "fuzz.object_parquet",
    "object-table": "fuzz.object_table",
    "predictions": "fuzz.predictions",
    "prior-table": "fuzz.prior_table",
    "procthor": "fuzz.procthor",
    "robot-json": "fuzz.robot_json",
    "spark-dsg": "fuzz.spark_dsg_text",
    "spark-dsg-binary": "fuzz.spark_dsg_binary",
    "statistics-zip": "fuzz.statistics_zip",
}


def find_target(name: str) -> Target:
    """Return a target by its name."""
    target = importlib.import_module(ROWS[name]).TARGET
    assert isinstance(target, Target)
    return target
