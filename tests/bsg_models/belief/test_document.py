"""A belief graph as JSON: without loss, and what is wrong is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_beliefs import make_belief
from refusals import refuses

from bsg_data.errors import BSGError
from bsg_models.belief.document import decode_belief, encode_belief
from bsg_models.belief.formats import read_belief, write_belief
from bsg_models.errors import BeliefFileError


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_decoding_inverts_encoding(seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    assert decode_belief(json.loads(json.dumps(encode_belief(belief))), path=Path("x")) == belief


def test_a_file_is_read_back(tmp_path: Path) -> None:
    write_belief(make_belief(1), tmp_path / "belief.json")
    assert read_belief(tmp_path / "belief.json") == make_belief(1)


def blind(**changes: Any) -> Any:
    node = {"room": 1, "class": "bed", "expected": 1, "presence": 1, **changes}
    return lambda document: document["blind"].append(node)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda d: d.pop("expected"), "belief-malformed"),
        (lambda d: d.update(version=9), "version-foreign"),
        (lambda d: d["expected"].pop(), "belief-inconsistent"),
        (lambda d: d["presence"][1].pop(), "belief-inconsistent"),
        (blind(**{"class": "ufo"}), "belief-inconsistent"),
        (blind(room=9), "belief-inconsistent"),
        (blind(presence=2), "belief-malformed"),
        (lambda d: d["expected"][1].__setitem__(0, -5), "belief-malformed"),
        (lambda d: d["class_space"]["classes"].reverse(), "belief-malformed"),
    ],
)
def test_what_is_no_belief_graph_is_refused(tmp_path: Path, change: Any, code: str) -> None:
    document = encode_belief(make_belief(1))
    change(document)
    path = tmp_path / "belief.json"
    path.write_text(json.dumps(document))
    with refuses(BeliefFileError, code, path):
        read_belief(path)


def test_fewer_objects_than_were_seen_are_refused(tmp_path: Path) -> None:
    seed = next(seed for seed in range(99) if make_belief(seed).inputs.any())
    document = encode_belief(make_belief(seed))
    document["expected"] = [[0.0] * len(row) for row in document["expected"]]
    with refuses(BeliefFileError, "belief-inconsistent", "x"):
        decode_belief(document, path=Path("x"))


@pytest.mark.parametrize("text", ["{", "[" * 100_000, "\udcff", None])
def test_what_is_no_json_is_refused(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "x.json"
    if text is not None:
        path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(BSGError):
        read_belief(path)
