"""Every script that makes a page of results, on a tiny leaderboard."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import REPOSITORY, load_script

from bsg_data.errors import DatasetError

PAGES = ("leaderboard", "masks", "fixtures", "ablation", "search")
FEW = {
    "masks": ["--draws=1", "--resamples=5", "--orders=1", "--models", "gamma-poisson@rooms"],
    "fixtures": ["--draws=2", "--resamples=5", "--models", "mixture@uniform"],
    "search": ["--draws=1", "--episodes=4", "--worlds", "star:1-10", "--models", "mixture@uniform"],
    "ablation": ["--draws=1", "--resamples=5", "--base=mixture@rooms"],
}


@pytest.mark.parametrize("name", PAGES)
def test_a_script_writes_its_page(board: Path, tmp_path: Path, name: str) -> None:
    page = tmp_path / f"{name}.md"
    argv = [f"--leaderboard={board}", f"--out={page}", *FEW.get(name, [])]
    assert load_script(f"measure/{name}").main(argv) == 0
    text = page.read_text("utf-8")
    assert text.startswith("# ")
    assert f"python scripts/measure/{name}.py --leaderboard=board --out={name}.md" in text
    assert "12 buildings, class space hm3d45-v2" in text
    assert str(tmp_path.parent) not in text
    assert "nan" not in text
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert tables
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_rooms_without_area_or_label_are_no_result(board: Path, tmp_path: Path) -> None:
    script = load_script("measure/room_size")
    with pytest.raises(DatasetError, match="no unvisited room has a known floor area"):
        script.main([f"--leaderboard={board}", f"--out={tmp_path / 'page.md'}", "--draws=1"])


def test_a_variant_is_compared_with_its_base(board: Path, tmp_path: Path) -> None:
    """A fixed zero where both are the same model, and the others by name."""
    page = tmp_path / "ablation.md"
    options = ["--draws=1", "--resamples=5", "--base=mixture@rooms"]
    script = load_script("measure/ablation")
    script.main([f"--leaderboard={board}", f"--out={page}", *options])
    rows = re.findall(r"^\| `(.+?)`", page.read_text("utf-8"), re.MULTILINE)
    assert rows == ["mixture@rooms", "gamma-poisson@rooms"]


@pytest.mark.parametrize("path", sorted((REPOSITORY / "docs" / "results").glob("*.md")), ids=str)
def test_a_page_of_the_docs_names_a_command_that_exists(path: Path) -> None:
    text = path.read_text("utf-8")
    commands = re.findall(r"^python (scripts/measure/\w+\.py)", text, re.MULTILINE)
    assert commands, f"{path.name}: names no command that makes it"
    for command in commands:
        assert (REPOSITORY / command).is_file(), f"{path.name}: {command} is not there"
