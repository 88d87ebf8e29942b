"""The table of bounds of SECURITY.md has the bounds of the code."""

from __future__ import annotations

import re

import pytest
from conftest import REPOSITORY

from bsg_data.inputs import bounded_file, bounds, parquet_pages
from bsg_data.inputs.bounds import GIB, KIB, MIB


def size(number: int) -> str:
    """Return bytes as the page writes them."""
    unit, name = next(one for one in ((GIB, "GiB"), (MIB, "MiB"), (KIB, "KiB")) if number >= one[0])
    return f"{number // unit:,} {name}"


def list_expected() -> dict[str, list[str]]:
    serve = pytest.importorskip("bsg_robot.service.bounds", reason="needs the extra serve")
    from bsg_robot.service import network, processes, questions

    packed = [f"{bounds.MAX_RATIO} times", size(bounded_file.UNSUSPICIOUS)]
    return {
        "JSON": [
            f"{bounds.MAX_CONTAINERS:,} lists",
            f"{bounds.MAX_VALUES:,} values",
            f"at most {bounds.MAX_KEYS:,}",
        ],
        "YAML, TOML": [
            f"{bounds.MAX_NESTING} deep",
            f"{bounds.MAX_NODES:,} texts",
            f"{bounds.MAX_TOML_LINE:,} characters",
        ],
        "packed files": packed,
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
        ],
        "Hydra's graph, a belief graph": [
            size(bounds.SPARK_DSG),
            size(bounds.BELIEF),
            f"{bounds.MAX_GRAPH_NODES:,} nodes",
            f"{bounds.MAX_GRAPH_EDGES:,} edges",
            f"{bounds.MAX_GRAPH_LABELS:,} labels",
        ],
        "an annotation of HM3D": [size(bounds.ANNOTATION), f"{bounds.MAX_INSTANCES:,} objects"],
        "names of objects of a building or a table": [f"{bounds.MAX_LETTERS_OF_OBJECTS:,} letters"],
        "a table of objects": [size(bounds.TABLE), f"{bounds.MAX_OBJECT_ROWS:,} rows"],
        "a house of ProcTHOR": [
            size(bounds.MAX_HOUSE),
            f"{bounds.MAX_HOUSE_ROOMS:,} rooms",
            f"{bounds.MAX_CORNERS} corners",
            f"{bounds.MAX_HOUSE_THINGS:,} objects",
        ],
        "a COBie spreadsheet": [
            size(bounds.COBIE),
            f"{bounds.MAX_MEMBERS:,} files",
            f"{bounds.MAX_ELEMENTS:,} elements",
            f"{bounds.MAX_NESTING} deep",
            f"a tag {size(bounds.MAX_TAG)} and {bounds.MAX_ATTRIBUTES} attributes",
            f"{bounds.MAX_NAMES:,} names of elements and attributes, of {bounds.MAX_NAME} letters",
            f"{size(bounds.SHEET_LIST)} of lists",
            f"{bounds.MAX_CELLS:,} cells",
            f"{bounds.MAX_SHEET_ROWS:,} rows",
            f"{bounds.MAX_SHEET_COLUMNS} columns",
            f"{bounds.MAX_CELL:,} letters",
            f"{bounds.MAX_LETTERS:,} in all",
            f"{bounds.MAX_SHEET_ROOMS:,} spaces",
        ],
        "a house of Matterport3D": [
            size(bounds.HOUSE),
            f"{bounds.MAX_HOUSE_LINES:,} lines of {size(bounds.MAX_LINE)}",
            f"{bounds.MAX_HOUSE_ROOMS:,} rooms",
            f"{bounds.MAX_HOUSE_PARTS:,} each",
        ],
        "a building with places of its rooms": [f"{bounds.MAX_HOUSE_ROOMS:,} rooms"],
        "lists of S3DIS and of BEHAVIOR-1K": [
            size(bounds.S3DIS),
            size(bounds.BEHAVIOR),
            f"{bounds.MAX_LISTED_SCENES:,} scenes",
            f"{bounds.MAX_LISTED:,} rooms and objects",
        ],
        "labels of rooms, room layouts, label spaces": [
            size(bounds.LABEL_TABLE),
            size(bounds.LAYOUT),
            size(bounds.LABEL_SPACE),
            f"{bounds.MAX_LABEL_ROWS:,} rows",
            f"{bounds.MAX_LABEL_COLUMNS:,} columns",
            f"a line {size(bounds.MAX_LINE)}",
        ],
        "parquet": [
            size(parquet_pages.MAX_PAGE),
            size(parquet_pages.MAX_WORDS),
            f"{parquet_pages.MAX_PAGES:,} pages",
            f"{size(parquet_pages.MAX_HEADERS)} of their headers",
            f"{parquet_pages.MAX_COLUMNS:,} columns",
        ],
        "a class map, a configuration": [
            size(bounds.CLASS_MAP),
            f"{bounds.MAX_MAP_ROWS:,} rows",
            size(bounds.CONFIG),
        ],
        "a question to `bsg-serve`, also by `--stdio`": [
            size(serve.MOST_BYTES),
            f"{questions.MOST_ROOMS} rooms",
            f"{questions.MOST_THINGS} things",
            f"{serve.SECONDS_TO_ASK:g} s to arrive",
            f"{processes.SECONDS_TO_WAIT:g} s of waiting",
            f"{processes.SECONDS_TO_ANSWER:g} s of answering",
        ],
        "all questions at a time": [
            size(serve.MOST_HELD),
            f"{network.MOST_CONNECTIONS:,} connections",
        ],
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
        # Numbers of the row that no constant gives: "nested 200 deep" is pydantic's own bound.
        said = {*re.findall(r"\d[\d,]*", rows[what])} - {"200"}
        assert said <= {*re.findall(r"\d[\d,]*", " ".join(each))}, what
