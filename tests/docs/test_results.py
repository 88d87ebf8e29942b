"""Results are told truly: where a figure comes from, what its data did before, who knew less."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from conftest import REPOSITORY, load_script

DOCS = load_script("write_docs")
RESULTS = REPOSITORY / "docs" / "results"
FIGURES = json.loads((RESULTS / "figures.json").read_text("utf-8"))
PAGES = sorted(RESULTS.glob("*.md"))
MADE = [pytest.param(one["made"], id=name) for name, one in FIGURES.items()]
SHOWN = re.compile(r"<!-- generated: figures (.+?) -->\n(.*?)<!-- end -->", re.DOTALL)
TABLES = [
    pytest.param(name.partition(" | ")[0], text, id=f"{page.stem}: {name[:40]}")
    for page in PAGES
    for name, text in SHOWN.findall(page.read_text("utf-8"))
]
HASH = re.compile(r"\b[0-9a-f]{16}\b")
MOST_TABLES = 3


@pytest.mark.parametrize("made", MADE)
def test_a_figure_names_the_commit_and_the_data_that_it_was_measured_on(
    made: dict[str, str],
) -> None:
    assert re.fullmatch(r"[0-9a-f]{8}\+?", made["commit"])
    assert HASH.search(made["dataset"]) or made["dataset"] == "made by the script"
    git = ["git", "cat-file", "-e", f"{made['commit'].rstrip('+')}:docs"]
    if subprocess.run(git, cwd=REPOSITORY, capture_output=True).returncode:
        pytest.skip("this checkout does not have old commits")


@pytest.mark.parametrize(("name", "shown"), TABLES)
def test_a_page_says_what_the_data_of_a_table_did_before(name: str, shown: str) -> None:
    measurement, _, title = name.partition("/")
    warning = DOCS.WARNINGS[FIGURES[measurement]["tables"][title]["tested_on"]]
    assert shown.rstrip().endswith(warning or "|")


@pytest.mark.parametrize(
    ("tested_on", "warns"), [("unseen", False), ("training", True), ("chosen", True)]
)
def test_a_warning_stands_under_a_table(
    tested_on: str, warns: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = {"tested_on": tested_on, "header": ["model", "a", "b"], "rows": [["x", "1", "2"]]}
    (tmp_path / "figures.json").write_text(json.dumps({"one": {"tables": {"t": table}}}), "utf-8")
    monkeypatch.setattr(DOCS, "FIGURES", tmp_path / "figures.json")
    text = DOCS.renew("<!-- generated: figures one/t | model; b -->\n<!-- end -->")
    assert "| x | 2 |" in text
    assert ("**" in text) == warns


@pytest.mark.parametrize(("name", "shown"), TABLES)
def test_a_table_of_models_says_which_of_them_are_told_less(name: str, shown: str) -> None:
    """In a column; `neither area nor label` is the first of those that tell all the same."""
    first, *columns = (cell.strip() for cell in shown.splitlines()[0].strip("|").split("|"))
    if first in ("model", "belief of") and "statistic" not in columns:
        assert {"reads labels", "told", "told besides objects", "neither area nor label"} & {
            *columns
        }, name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_has_few_tables_and_a_figure_under_each_claim(page: Path) -> None:
    text = page.read_text("utf-8")
    assert len(SHOWN.findall(text)) <= MOST_TABLES
    last = max(one.start() for one in SHOWN.finditer(text))
    claims = [one.start() for one in re.finditer(r"^\*\*", SHOWN.sub("", text), re.MULTILINE)]
    assert claims, "the answer comes first"
    assert SHOWN.sub("", text[last:]).count("\n**") == 0


def test_figures_of_the_readme_come_from_scripts_of_the_tree(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    read = set()
    find = DOCS._find_table

    def note(measurement: str, title: str) -> dict[str, object]:
        read.add(measurement)
        return dict(find(measurement, title))

    monkeypatch.setattr(DOCS, "_find_table", note)
    for name, show in DOCS.RESULTS.items():
        assert f"<!-- generated: results {name} -->" in (REPOSITORY / "README.md").read_text()
        assert show()
    assert read
    assert not [name for name in read if "last_in" in FIGURES[name]["made"]]


def test_the_printed_build_gives_the_dataset_that_figures_name() -> None:
    """Without its meshes, HM3D is the same for all who have its texts."""
    text = (RESULTS / "leaderboard.md").read_text("utf-8")
    (build,) = re.findall(r"^bsg-data build --hm3d.*$", text, re.MULTILINE)
    assert "--no-meshes" in build
    ((commit, told),) = re.findall(r"# at commit (\S{8}) begins with ([0-9a-f]{16})", text)
    made = FIGURES["leaderboard"]["made"]
    assert (commit, told in made["dataset"]) == (made["commit"], True)
