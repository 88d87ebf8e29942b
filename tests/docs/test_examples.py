"""The files of docs/examples run: those of ROS 2 in tests/cli/ros."""

from __future__ import annotations

import re
import runpy

import pytest
from conftest import REPOSITORY

EXAMPLES = REPOSITORY / "docs" / "examples"


def test_the_lines_of_the_page_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Beside docs/office.json and the example."""
    monkeypatch.chdir(REPOSITORY / "docs")
    monkeypatch.syspath_prepend(EXAMPLES)
    text = (REPOSITORY / "docs" / "robot-software.md").read_text("utf-8")
    (block,) = re.findall(r"<!-- planners -->\n```python\n(.*?)```", text, re.DOTALL)
    exec(compile(block, "docs/robot-software.md", "exec"), {"__name__": "planning"})
    assert capsys.readouterr().out.split() == re.findall("# → (.*)", block)


def test_the_search_with_a_planner_finds_everything(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "search_with_a_planner.py"), run_name="__main__")
    *steps, last = capsys.readouterr().out.splitlines()
    assert steps[0] == "washstand_3: towel"
    assert sum(": nothing" not in step for step in steps) == 3
    assert last == "all found after 73 s"
