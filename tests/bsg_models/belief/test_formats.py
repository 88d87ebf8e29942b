"""Formats are chosen by suffix, and one more is one row in an entry point."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY
from random_beliefs import make_belief

from bsg_data import registry
from bsg_data.errors import RecipeError
from bsg_models.belief.formats import (
    FORMATS,
    FormatRow,
    choose_format,
    read_belief,
    read_beliefs,
    write_belief,
    write_beliefs,
)
from bsg_models.errors import BeliefFileError

OUTSIDE = """
from pathlib import Path
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.formats import FormatRow

def write_list(belief: BeliefGraph, path: Path) -> None:
    classes = belief.partial.class_space.classes
    lines = [f"{node.room_index} {classes[node.class_index]}" for node in belief.blind]
    path.write_text("\\n".join(lines))

LIST = FormatRow("list", (".list",), write=write_list)
"""


@pytest.mark.parametrize("name", ["b.json", "b.dsg.json", "b.tables", "B.JSON"])
def test_what_is_written_by_suffix_is_read_by_suffix(tmp_path: Path, name: str) -> None:
    if "dsg" in name:
        pytest.importorskip("spark_dsg")
    write_belief(make_belief(1), tmp_path / name)
    assert read_belief(tmp_path / name) == make_belief(1)


def test_the_longest_suffix_is_chosen_and_a_name_goes_before_it() -> None:
    assert choose_format(Path("b.json")).name == "json"
    assert choose_format(Path("b.dsg.json")).name == "spark-dsg"
    assert choose_format(Path("b.json"), "spark-dsg").name == "spark-dsg"
    assert choose_format(Path("folder/b.html")).name == "html"


@pytest.mark.parametrize("name", ["belief", "b.csv", ".json", "b.json.gz"])
def test_an_unknown_suffix_is_named_with_those_that_are_known(name: str) -> None:
    with pytest.raises(RecipeError, match=r"\.json \(json\), \.tables \(tables\), \.dsg\.json"):
        choose_format(Path(name))


def test_an_unknown_format_gets_the_nearest() -> None:
    with pytest.raises(RecipeError, match="did you mean tables"):
        write_belief(make_belief(1), Path("x"), format="table")


def test_several_graphs_need_a_format_of_many(tmp_path: Path) -> None:
    beliefs = [make_belief(1), make_belief(2, scene_id="t")]
    write_beliefs(iter(beliefs), tmp_path / "b.tables")
    assert read_beliefs(tmp_path / "b.tables") == beliefs
    with pytest.raises(BeliefFileError, match="expected one belief graph, found 2"):
        read_belief(tmp_path / "b.tables")
    with pytest.raises(RecipeError, match=r"holds one belief graph, and there are 2.*tables"):
        write_beliefs(beliefs, tmp_path / "b.json")
    assert not (tmp_path / "b.json").exists()


def test_a_page_is_written_and_not_read(tmp_path: Path) -> None:
    write_belief(make_belief(1), tmp_path / "b.html")
    assert (tmp_path / "b.html").read_text("utf-8").startswith("<!doctype html>")
    with pytest.raises(RecipeError, match="html is written only"):
        read_belief(tmp_path / "b.html")


def test_rows_are_complete() -> None:
    for name in FORMATS:
        row = FORMATS[name]
        assert row.name == name
        assert (row.read is None) or (row.write is not None)
        assert (row.read_all is None) or row.many
    with pytest.raises(RecipeError, match="neither"):
        FormatRow("x", (".x",))
    with pytest.raises(RecipeError, match="begins with a dot"):
        FormatRow("x", ("x",), write=lambda belief, path: None)


def test_a_format_from_outside_is_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "outside"
    (package / "outside-1.dist-info").mkdir(parents=True)
    (package / "outside_format.py").write_text(OUTSIDE)
    (package / "outside-1.dist-info" / "METADATA").write_text("Name: outside\nVersion: 1\n")
    (package / "outside-1.dist-info" / "entry_points.txt").write_text(
        "[bsg_models.formats]\nlist = outside_format:LIST\nbroken = no_such_module:ROW\n"
    )
    monkeypatch.syspath_prepend(package)
    registry._installed.cache_clear()
    try:
        belief = make_belief(1)
        write_belief(belief, tmp_path / "b.list")
        lines = (tmp_path / "b.list").read_text().splitlines()
        assert len(lines) == len(belief.blind)
        write_belief(belief, tmp_path / "b.json")  # the broken one is in nobody's way
        assert json.loads((tmp_path / "b.json").read_text())["model"] == "random"
        with pytest.raises(RecipeError, match="no_such_module"):
            choose_format(Path("b.unknown"))
    finally:
        registry._installed.cache_clear()


def test_choosing_a_format_loads_no_heavy_library() -> None:
    code = (
        "import sys, types\n"
        "root = sys.modules['bsg_models'] = types.ModuleType('bsg_models')\n"
        f"root.__path__ = [{str(REPOSITORY / 'bsg_models')!r}]\n"  # without what the root exports
        "from bsg_models.belief.formats import FORMATS\n"
        "FORMATS.names()\n"
        "assert 'bsg_models.rendering.explorer' not in sys.modules\n"
        "assert not {'spark_dsg', 'networkx', 'torch'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
