from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import AnnotationError
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.hm3d import HEADER, parse_annotation

FILE = Path("scene.semantic.txt")


def parse(*lines: str | bytes) -> tuple[SceneObject, ...]:
    encoded = [line if isinstance(line, bytes) else line.encode() for line in (HEADER, *lines)]
    return parse_annotation(b"\n".join(encoded) + b"\n", path=FILE)


def test_a_file_by_hand() -> None:
    found = parse('2,F3A,"magazines, albums",0', '1,00ff00,"śign",-1', "", '9,0,"a "big" box",12')
    assert found == (
        SceneObject(0, 1, -1, "śign", colour="00FF00"),
        SceneObject(0, 2, 0, "magazines, albums", colour="000F3A"),
        SceneObject(0, 9, 12, 'a "big" box', colour="000000"),
    )


def test_byte_order_mark_carriage_returns_and_odd_separators_in_names() -> None:
    data = b'\xef\xbb\xbfHM3D Semantic Annotations\r\n1,AB,"a\xe2\x80\xa8b",0\r\n'
    assert parse_annotation(data, path=FILE) == (SceneObject(0, 1, 0, "a\u2028b", colour="0000AB"),)


@pytest.mark.parametrize(
    "line",
    [
        '1,AB,"chair"',
        'x,AB,"chair",1',
        '1,1234567,"chair",1',
        '1,AB,"chair,1',
        '1,AB,"chair",1.5',
        '1,AB,"chair",٣',
        '12345678901,AB,"chair",1',
        '7,AC,"chair",1',
        '8,0000ff,"chair",1',
        b'8,AC,"ch\xe4ir",1',
    ],
)
def test_a_malformed_line_is_named(line: str | bytes) -> None:
    with refuses(AnnotationError, "line-malformed", "scene.semantic.txt, line 3"):
        parse('7,FF,"table",0', line)


@pytest.mark.parametrize("data", [b"", b'1,AB,"chair",1\n', b"\x00\x01\x02", b"GIF89a"])
def test_another_file_is_refused_by_its_first_line(data: bytes) -> None:
    with refuses(AnnotationError, "line-malformed", f"{FILE}, line 1"):
        parse_annotation(data, path=FILE)


def test_a_header_alone_is_refused() -> None:
    with refuses(AnnotationError, "line-malformed", f"{FILE}, line 1"):
        parse()


names = st.text(st.characters(exclude_characters="\n\r", exclude_categories=["Cs"]), max_size=20)


@given(
    st.lists(
        st.tuples(st.integers(0, 10**9 - 1), names, st.integers(-5, 1000)),
        min_size=1,
        unique_by=lambda row: row[0],
    )
)
def test_any_names_come_back_exactly(rows: list[tuple[int, str, int]]) -> None:
    text = [f'{i},{k:X},"{name}",{region}' for k, (i, name, region) in enumerate(rows)]
    found = parse(*text)
    assert {(f.instance_id, f.raw_category, f.room_index) for f in found} == set(rows)
    assert [f.instance_id for f in found] == sorted(i for i, _, _ in rows)
