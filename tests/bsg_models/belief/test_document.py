"""A belief graph as JSON: without loss, and what is wrong is named."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_beliefs import (
    be_sure,
    forget_surroundings,
    header_of_version_1,
    header_of_version_2,
    header_of_version_3,
    make_belief,
)

from bsg_data.errors import BSGError
from bsg_models.belief.document import (
    decode_belief,
    encode_belief,
    read_document,
    write_document,
)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), mode=st.sampled_from(["complete", "unseen"]))
def test_decoding_inverts_encoding(seed: int, mode: str) -> None:
    belief = make_belief(seed, mode=mode)
    assert decode_belief(json.loads(json.dumps(encode_belief(belief))), path=Path("x")) == belief


def test_a_file_is_read_back(tmp_path: Path) -> None:
    write_document(make_belief(1), tmp_path / "belief.json")
    assert read_document(tmp_path / "belief.json") == make_belief(1)


def test_version_1_names_a_class_map_and_is_read() -> None:
    document = header_of_version_1(encode_belief(make_belief(1)))
    for obj in document["partial"]["objects"]:
        del obj["corrected"], obj["class"]
    assert decode_belief(document, path=Path("x")) == make_belief(1)
    document["class_map"]["sha256"] = "1" * 64
    with pytest.raises(BSGError, match="has changed since"):
        decode_belief(document, path=Path("x"))
    document["class_map"]["version"] = "/etc/passwd.csv"
    with pytest.raises(BSGError, match="is no published one"):
        decode_belief(document, path=Path("x"))


def test_version_2_has_no_surroundings_and_is_read() -> None:
    document = header_of_version_2(encode_belief(make_belief(1)))
    for room in document["partial"]["rooms"]:
        del room["floor_area"], room["room_type"], room["hidden_share_sd"]
    assert decode_belief(document, path=Path("x")) == forget_surroundings(make_belief(1))


def test_version_3_is_sure_of_every_share_and_is_read() -> None:
    document = header_of_version_3(encode_belief(make_belief(1)))
    for room in document["partial"]["rooms"]:
        del room["hidden_share_sd"]
    assert be_sure(make_belief(1)) != make_belief(1)
    assert decode_belief(document, path=Path("x")) == be_sure(make_belief(1))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda d: d.pop("expected"), "expected: Field required"),
        (lambda d: d.update(version=9), "found bsg-belief-graph 9"),
        (lambda d: d["expected"].pop(), "expected histograms"),
        (
            lambda d: d["blind"].append({"room": 1, "class": "ufo", "expected": 1, "presence": 1}),
            "'ufo', which is no class",
        ),
        (
            lambda d: d["blind"].append({"room": 9, "class": "bed", "expected": 1, "presence": 1}),
            "a blind node in room 9; rooms are 1 to",
        ),
        (
            lambda d: d["blind"].append({"room": 1, "class": "bed", "expected": 1, "presence": 1}),
            "has another presence than its room",
        ),
        (
            lambda d: d["blind"].append({"room": 1, "class": "bed", "expected": 1, "presence": 2}),
            "presence",
        ),
        (lambda d: d["expected"][1].__setitem__(0, -5), "expected.1.0"),
        (lambda d: d["expected"][1].__setitem__(0, float("inf")), "Infinity, which is no number"),
        (lambda d: d["presence"][1].__setitem__(0, 7), "presence.1.0"),
        (lambda d: d["expected"][1].pop(), "expected histograms"),
        (lambda d: d["class_space"].update(sha256="1" * 64), "is not that of its classes"),
        (lambda d: d["class_space"]["classes"].reverse(), "is not that of its classes"),
        (lambda d: d["partial"]["objects"][0].update({"class": "axe"}), "is no class of hm3d45"),
        (lambda d: d["partial"].update(rooms=3), "rooms"),
        (lambda d: d["partial"].update(building_kind="castle"), "known are home, office"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_the_reason(
    tmp_path: Path, change: Any, expected: str
) -> None:
    document = encode_belief(make_belief(1))
    change(document)
    path = tmp_path / "belief.json"
    path.write_text(json.dumps(document))
    with pytest.raises(BSGError, match=expected):
        read_document(path)


@pytest.mark.parametrize("text", ["{", "[" * 100_000, "\udcff"])
def test_what_is_no_json_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(BSGError, match=r"x\.json: no JSON"):
        read_document(path)
    with pytest.raises(BSGError, match="cannot be read"):
        read_document(tmp_path / "none.json")
