"""Formats are chosen by suffix, and one more is one row in an entry point."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_beliefs import make_belief
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_robot.errors import BeliefFileError
from bsg_robot.graph.document import decode_belief, encode_belief
from bsg_robot.graph.formats import (
    FORMATS,
    choose_format,
    read_belief,
    write_belief,
    write_beliefs,
)


@pytest.mark.parametrize(
    ("name", "chosen"),
    [("B.JSON", "json"), ("b.dsg.json", "spark-dsg"), ("folder/b.html", "html")],
)
def test_the_longest_suffix_is_chosen(name: str, chosen: str) -> None:
    assert choose_format(Path(name)).name == chosen


@pytest.mark.parametrize("name", ["belief", "b.csv", ".json", "b.json.gz"])
def test_an_unknown_suffix_is_refused(name: str) -> None:
    with refuses(RecipeError, "format-unknown", name):
        choose_format(Path(name))


def test_several_graphs_need_a_format_of_many(tmp_path: Path) -> None:
    beliefs = [make_belief(1), make_belief(2, scene_id="t")]
    write_beliefs(iter(beliefs), tmp_path / "b.html", FORMATS["html"])
    with refuses(RecipeError, "format-written-only", tmp_path / "b.html"):
        read_belief(tmp_path / "b.html")
    with refuses(RecipeError, "graphs-several", tmp_path / "b.json"):
        write_beliefs(beliefs, tmp_path / "b.json", FORMATS["json"])
    assert not (tmp_path / "b.json").exists()


def test_a_graph_of_hydra_is_not_made_anew(tmp_path: Path) -> None:
    with refuses(RecipeError, "format-not-new", tmp_path / "b.dsg.json"):
        write_belief(make_belief(1), tmp_path / "b.dsg.json")
    assert not any(tmp_path.iterdir())


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_decoding_inverts_encoding(seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    assert decode_belief(json.loads(json.dumps(encode_belief(belief))), path=Path("x")) == belief


def blind(**changes: Any) -> Any:
    node = {"room": 1, "class": "bed", "expected": 1, "presence": 1, **changes}
    return lambda document: document["blind"].append(node)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda d: d.pop("expected"), "belief-malformed"),
        (lambda d: d.update(version=9), "belief-malformed"),
        (lambda d: d["expected"].pop(), "belief-inconsistent"),
        (lambda d: d["presence"][1].pop(), "belief-inconsistent"),
        (blind(**{"class": "ufo"}), "belief-inconsistent"),
        (blind(presence=2), "belief-malformed"),
        (lambda d: d["expected"][1].__setitem__(0, -5), "belief-malformed"),
        (lambda d: d.update(expected=[[0.0] * 45 for _ in d["expected"]]), "belief-inconsistent"),
        (lambda d: d["class_space"]["classes"].reverse(), "belief-malformed"),
    ],
)
def test_what_is_no_belief_graph_is_refused(tmp_path: Path, change: Any, code: str) -> None:
    document = encode_belief(make_belief(2))
    change(document)
    path = tmp_path / "belief.json"
    path.write_text(json.dumps(document))
    with refuses(BeliefFileError, code, path):
        read_belief(path)
