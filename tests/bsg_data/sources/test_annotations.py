from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.inputs.bounds import Bound
from bsg_data.sources.annotations import HEADER, Instance, parse_annotation, read_annotation

FILE = Path("scene.semantic.txt")


def parse(*lines: str | bytes) -> tuple[Instance, ...]:
    encoded = [line if isinstance(line, bytes) else line.encode() for line in (HEADER, *lines)]
    return parse_annotation(b"\n".join(encoded) + b"\n", path=FILE)


def test_a_file_by_hand() -> None:
    found = parse('2,F3A,"magazines, albums",0', '1,00ff00,"śign",-1', "", '9,0,"a "big" box",12')
    assert found == (
        Instance(1, "śign", -1, "00FF00"),
        Instance(2, "magazines, albums", 0, "000F3A"),
        Instance(9, 'a "big" box', 12, "000000"),
    )


def test_byte_order_mark_carriage_returns_and_odd_separators_in_names() -> None:
    data = b'\xef\xbb\xbfHM3D Semantic Annotations\r\n1,AB,"a\xe2\x80\xa8b",0\r\n'
    assert parse_annotation(data, path=FILE) == (Instance(1, "a\u2028b", 0, "0000AB"),)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('1,AB,"chair"', "id,HEXRGB"),
        ('1,AB,"chair",', "id,HEXRGB"),
        ('x,AB,"chair",1', "id,HEXRGB"),
        ('1,GG,"chair",1', "id,HEXRGB"),
        ('1,1234567,"chair",1', "id,HEXRGB"),
        ('1,AB,"chair,1', "id,HEXRGB"),
        ('1,AB,"chair",1.5', "id,HEXRGB"),
        ('1,AB,"chair",٣', "id,HEXRGB"),
        ('12345678901,AB,"chair",1', "id,HEXRGB"),
        ('7,AC,"chair",1', "an id that no earlier line has"),
        ('8,0000ff,"chair",1', "a colour that no earlier line has"),
        (b'8,AC,"ch\xe4ir",1', "UTF-8"),
    ],
)
def test_a_malformed_line_is_named(line: str | bytes, expected: str) -> None:
    with pytest.raises(AnnotationError) as caught:
        parse('7,FF,"table",0', line)
    assert caught.value.line_number == 3
    assert expected in caught.value.expected
    assert "scene.semantic.txt, line 3: expected" in str(caught.value)


@pytest.mark.parametrize("data", [b"", b'1,AB,"chair",1\n', b"\x00\x01\x02", b"GIF89a"])
def test_another_file_is_refused_by_its_first_line(data: bytes) -> None:
    with pytest.raises(AnnotationError, match="HM3D Semantic Annotations"):
        parse_annotation(data, path=FILE)


def test_a_header_alone_is_refused() -> None:
    with pytest.raises(AnnotationError, match="at least one annotated instance"):
        parse()


def test_a_truncated_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "cut.semantic.txt"
    path.write_bytes(b'HM3D Semantic Annotations\n1,AB,"chair",1\n2,CD,"tab')
    with pytest.raises(AnnotationError, match="line 3"):
        read_annotation(path)


def test_a_missing_and_a_huge_file_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SourceError, match="cannot be read"):
        read_annotation(tmp_path / "none.semantic.txt")
    path = tmp_path / "huge.semantic.txt"
    path.write_bytes(HEADER.encode())
    monkeypatch.setattr("bsg_data.sources.annotations.ANNOTATION", Bound("", 10))
    with pytest.raises(SourceError, match="at most 10"):
        read_annotation(path)


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
    assert {(f.instance_id, f.name, f.region_id) for f in found} == set(rows)
    assert [f.instance_id for f in found] == sorted(i for i, _, _ in rows)
