"""Matterport3D's `.house` text: a house by hand, every malformed line, and the real ones."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import pytest
from house_files import HOUSE, change
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.scene.scene_graph import Box
from bsg_data.sources.house_file import parse_house

PATH = Path("house.house")


def test_a_house_by_hand() -> None:
    house = parse_house(HOUSE, path=PATH)
    assert house.levels == (0.0,)
    assert [region.label for region in house.regions] == ["k", "b", "Z"]
    assert house.regions[1].box == Box((4.1, 0, 0.1), (8, 4, 2.5))
    assert house.regions[0].polygons == (((0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)),)
    assert house.regions[2].polygons == ()
    assert house.portals == ((0, 1),)
    assert (house.categories[1], house.categories[3]) == ("coffee table", "wall /otherroom")
    assert [(region, category) for region, category, _ in house.objects] == [
        (0, 1),
        (1, 2),
        (1, -1),
        (-1, 0),
        (2, 3),
    ]
    assert house.objects[0][2] == Box((0.5, 0.75, 0), (1.5, 1.25, 0.5))
    turned = house.objects[1][2]  # a square of 2 m turned by 45 degrees is 2 √2 m wide
    assert turned is not None
    assert turned.minimum == pytest.approx((6 - 2**0.5, 2 - 2**0.5, 0), abs=1e-6)
    assert turned.maximum == pytest.approx((6 + 2**0.5, 2 + 2**0.5, 1), abs=1e-6)
    assert house.objects[2][2] is None, "radii below 0 are an empty box"


def test_a_portal_may_be_written_as_an_r() -> None:
    text = change("P  0 0 1", "R  0 1 0  D  4 1 0  4.1 2 2  0 0 0 0")
    assert parse_house(text, path=PATH) == parse_house(HOUSE, path=PATH)


def test_an_empty_region_is_inside_out() -> None:
    empty = "R  2 -1  0 0  -  0 0 0  1e+30 1e+30 1e+30  -1e+30 -1e+30 -1e+30  0  0 0 0 0"
    house = parse_house(change("R  2", empty), path=PATH)
    assert (house.regions[2].box, house.regions[2].level) == (None, -1)


@pytest.mark.parametrize(
    ("line", "other"),
    [
        ("ASCII", "ASCII 1.0"),
        ("H  -", "-"),
        ("L  0", "H  -  -  1"),
        ("I  0", "-"),
        ("P  00ebb", "-"),
        ("P  0 0 1", "-"),
        ("H  -", "H  -  -  many"),
        ("H  -", "H  -  -"),
        ("R  1", "R  2 0  0 0  b"),
        ("R  1", "R  1 1  0 0  b"),
        ("R  1", "R  1 0  0 0  b  6 2 0  4.1 0 nan  8 4 2.5"),
        ("R  1", "R  1 0  0 0  b  6 2 0  4.1 0 0.1  8 4 1e9"),
        ("R  1", "R  1 0  0 0  b  6 2 0  9 0 0.1  8 4 2"),
        ("S  1", "S  1 7  0"),
        ("V  9", "V  9 5  F  0 0 0"),
        ("V  9", "V  9 1  F  0 inf 0"),
        ("O  0", "O  0 3 1"),
        ("O  0", "O  0 0 4"),
        ("O  0", "O  0 0 1  1 1 0.25  1 0 0  0 1 0  0.5 x 0.25"),
        ("O  0", "O  0 0 1  1 1 0.25  9 0 0  0 1 0  1 1 1"),
        ("O  1", "-"),
        ("E  0", "X  0"),
    ],
)
def test_a_malformed_line_is_named(line: str, other: str) -> None:
    with refuses(AnnotationError, "line-malformed"):
        parse_house(change(line, other), path=PATH)


@given(st.lists(st.sampled_from(HOUSE.split("\n")), max_size=40), st.integers(0, 60))
def test_lines_in_any_order_give_a_house_or_a_source_error(lines: Sequence[str], cut: int) -> None:
    text = "\n".join(["ASCII 1.1", *lines])
    for damaged in (text, text[: len(text) - cut], re.sub("1", "9" * 9, text)):
        with suppress(SourceError):
            parse_house(damaged, path=PATH)
