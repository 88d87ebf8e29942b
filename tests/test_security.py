"""The table of bounds of SECURITY.md has the bounds of the code."""

from __future__ import annotations

import re

import pytest
from conftest import REPOSITORY

from bsg_data.inputs import bounds
from bsg_robot.graph import memory


def size(number: int) -> str:
    """Return bytes as the page writes them."""
    return f"{number // 2**20:,} MiB"


def list_expected() -> dict[str, list[str]]:
    serve = pytest.importorskip("bsg_robot.service.http", reason="needs the extra serve")
    from bsg_robot.service import pool, questions

    return {
        "a robot's graph": [
            size(bounds.ROBOT),
            f"{bounds.MAX_ROBOT_ROOMS:,} rooms",
            f"{bounds.MAX_ROBOT_OBJECTS:,} objects with {bounds.MAX_ROBOT_LETTERS:,} letters",
            f"{bounds.MAX_CORNERS} corners",
            f"{bounds.MAX_ALL_CORNERS:,} of all",
            f"{bounds.MAX_ROBOT_PAIRS:,} pairs",
            f"{bounds.MAX_ROBOT_TYPES:,} labels",
            f"{bounds.MAX_ROBOT_KINDS:,} different",
            f"{bounds.MAX_ROBOT_LOOKS:,} looks for {bounds.MAX_ROBOT_SOUGHT} different",
            f"{bounds.MAX_ROBOT_WORDS:,} words",
            f"{memory.MOST_IN_ALL:,} sightings in memory, {memory.MOST_SIGHTINGS} of each",
            f"{bounds.MAX_ROBOT_CUSTOMS:,} customs",
        ],
        "Hydra's graph, a belief graph": [
            size(bounds.SPARK_DSG),
            size(bounds.BELIEF),
            f"{bounds.MAX_GRAPH_NODES:,} nodes",
            f"{bounds.MAX_GRAPH_EDGES:,} edges",
            f"{bounds.MAX_GRAPH_LABELS:,} labels",
        ],
        "any of these, JSON": [f"{bounds.MAX_VALUES:,} values"],
        "a question to `bsg-serve`": [
            size(serve.MOST_BYTES),
            f"{questions.MOST_ROOMS} rooms",
            f"{questions.MOST_THINGS} things",
            f"{pool.SECONDS_TO_WAIT:g} s of waiting",
            f"{pool.SECONDS_TO_ANSWER:g} s of answering",
        ],
        "all questions at a time": [f"{serve.MOST_CONNECTIONS:,} connections"],
    }


def test_the_table_has_the_bounds_of_the_code() -> None:
    page = (
        (REPOSITORY / "SECURITY.md").read_text("utf-8").partition("| what | at most |\n|---|---|")
    )
    rows = dict(re.findall(r"^\| (.+?) \| (.+) \|$", page[2], re.MULTILINE))
    expected = list_expected()
    assert list(rows) == list(expected)
    for what, each in expected.items():
        for one in each:
            assert one in rows[what], what
        said = {*re.findall(r"\d[\d,]*", rows[what])}
        assert said <= {*re.findall(r"\d[\d,]*", " ".join(each))}, what
