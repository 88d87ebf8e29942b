"""`bsg-belief` end to end: a robot's graph and masked buildings, every output, bad input."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest
from commands import runner
from conftest import REPOSITORY
from dsg_files import write_graph

import bsg_models
from bsg_cli.belief import main
from bsg_data.dataset.dataset import Dataset
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.found_model import TERMS, read_shipped_card
from bsg_models.runs.model_card import read_card
from bsg_robot.graph.formats import read_belief

call = runner(main)


OFFICE = REPOSITORY / "docs" / "office.json"


def test_a_robots_graph_gives_every_output(run: Path, tmp_path: Path) -> None:
    out, page = tmp_path / "b.json", tmp_path / "b.html"
    words = (OFFICE, "--model", run, "--out", out, "--out", page)
    done = call(*words, "--top", 2)
    assert "B: shared kitchen" in done.output
    assert f"1 belief graph, {len(read_belief(out).blind)} blind nodes" in done.output
    assert page.read_text("utf-8").startswith("<!doctype html>")
    assert "is there already; --force replaces it" in call(*words, code=1).stderr
    call(*words, "--force")
    refused = call(*words, "--force", "--out", tmp_path / "h.dsg.json", code=2)
    assert "adds beliefs to one graph of its program" in refused.stderr


def test_who_names_no_model_is_told_the_terms_of_the_default_one(run: Path) -> None:
    assert call(OFFICE, "--find", "mug").stderr.splitlines()[0] == TERMS
    assert call(OFFICE, "--json").stderr.splitlines()[0] == TERMS
    assert "research" not in call(OFFICE, "--find", "mug", "--quiet").stderr
    assert "research" not in call(OFFICE, "--model", "universal").stderr
    assert "research" not in call(OFFICE, "--model", run).stderr


def test_the_terms_are_those_of_the_cards() -> None:
    default, advised = TERMS.partition(":")[0], TERMS.split()[-1]
    assert default == bsg_models.DEFAULT_MODEL
    cards = (read_card(read_shipped_card(name), origin=name) for name in (default, advised))
    assert [card.is_restricted for card in cards] == [True, False]


def test_a_graph_of_hydra_comes_back_with_beliefs(run: Path, tmp_path: Path) -> None:
    pytest.importorskip("spark_dsg")
    packed = tmp_path / "dsg.json.gz"
    packed.write_bytes(gzip.compress((REPOSITORY / "docs" / "dsg.json").read_bytes()))
    out, other = tmp_path / "out.dsg.json", tmp_path / "other.dsg.json"
    words = ("--model", run, "--labels", "mpcat40", "--out")
    assert "1 of 9 objects under no room" in call(packed, *words, out).stderr
    call(out, *words, other)
    assert read_belief(out) == read_belief(other), "the second annotation replaces the first"


def test_shares_are_told(dataset: Path, run: Path, tmp_path: Path) -> None:
    path = write_graph(tmp_path / "dsg.json")
    shares = ("--hidden-share", "0.25", "--hidden-share", "kitchen=0", "--hidden-share", "R(3)=1")
    out = tmp_path / "b.json"
    done = call(path, "--model", run, *shares, "--out", out)
    assert "count as not seen" not in done.stderr
    rooms = read_belief(out).partial.rooms
    assert [(room.hidden_share, room.visited) for room in rooms] == [
        (0, True),
        (0.99, False),  # it shows something
    ]
    assert "1 object with labels that nobody names (99)" in done.stderr
    for wrong in ("x", "kitchen=nan", "attic=0.5"):
        call(path, "--model", run, "--hidden-share", wrong, code=2)
    call(path, "--model", run, *shares, "--hidden-share", "0.2", code=2)
    call(dataset, "--model", run, "--hidden-share", "0.5", code=2)


def test_masked_buildings_give_a_belief_graph_each(
    dataset: Path, run: Path, tmp_path: Path
) -> None:
    words = (dataset, "--model", run, "--split", "train", "--mode", "unseen")
    done = call(*words, "--out", tmp_path / "b.html", "--json")
    answers = json.loads(done.stdout)
    shown = (tmp_path / "b.html").read_text("utf-8")
    scenes = set(scenes_of(Dataset.open(dataset), "train"))
    assert {answer["scene_id"] for answer in answers} == scenes
    assert all(f'"title":"{scene}"' in shown for scene in scenes)
    assert all(len(answer["unseen"]) <= 3 for answer in answers)
    single = call(dataset, "--model", run, "--scene", answers[0]["scene_id"], "--json")
    assert {answer["scene_id"] for answer in json.loads(single.stdout)} == {answers[0]["scene_id"]}


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ((), 2),
        (("dataset", "--scene", "nowhere"), 1),
        (("dataset", "--split", "train", "--out", "x.json"), 2),
        (("dataset", "--find", "sink"), 2),
        (("dataset", "--labels", "mpcat40"), 2),
        (("dataset", "--room-labels", "words.csv"), 2),
        ((str(OFFICE), "--room-labels", "words.csv"), 1),
        ((str(OFFICE), "--mask", "rooms"), 2),
        ((".",), 2),
    ],
)
def test_what_cannot_be_done_is_refused(
    dataset: Path, run: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], code: int
) -> None:
    monkeypatch.chdir(dataset.parent)
    assert call(*words, "--model", run, code=code).stdout == ""


@pytest.mark.usefixtures("shipped")
def test_a_model_that_is_not_named_is_the_shipped_one(run: Path) -> None:
    asked = call(OFFICE, "--json")
    for words in (("--model", "other"), ("--model", run)):
        assert call(OFFICE, *words, "--json").stdout == asked.stdout
    assert call(OFFICE).stdout.endswith("by universal\n")
    assert "did you mean universal?" in call(OFFICE, "--model", "universl", code=1).stderr


def test_a_page_is_opened_in_the_browser(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: not shown.append(address))
    page = tmp_path / "home.html"
    words = (OFFICE, "--model", run, "--find", "sink", "--open")
    assert "go first to" in call(*words, "--out", page).stdout
    assert shown == [page.as_uri()]
    assert '"thing":"sink"' in page.read_text("utf-8"), "the page has the answer"
    monkeypatch.setattr("webbrowser.open", lambda address: False)
    assert str(page) in call(*words, "--out", page, "--force").stderr
    call(*words, code=2)
    call(*words, "--out", tmp_path / "b.json", code=2)
