"""Parquet of strangers: judged by its footer, and damaged in any way one error."""

from __future__ import annotations

import io
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.errors import DatasetError, SourceError
from bsg_data.inputs import parquet
from bsg_data.inputs.parquet import open_parquet_file, reading_parquet, words_of


def encode(table: pa.Table, *, statistics: bool = True) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer, write_statistics=statistics)
    return buffer.getvalue()


WHOLE = encode(
    pa.table(
        {
            "name": ["chair", "bed", None],
            "list": [[1.0], [], [2.0, 3.0]],
            "kind": [[("hall", 0.5)], None, []],
        },
        pa.schema(
            [
                ("name", pa.string()),
                ("list", pa.list_(pa.float64())),
                ("kind", pa.list_(pa.struct([("label", pa.string()), ("share", pa.float64())]))),
            ],
            {"a": "b"},
        ),
    )
)


def test_what_is_sound_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.parquet").write_bytes(WHOLE)
    with reading_parquet(tmp_path / "a.parquet", rows=3) as file:
        assert file.read()["name"].to_pylist() == ["chair", "bed", None]
        assert words_of(file.schema_arrow)["a"] == "b"


@pytest.mark.parametrize("rows", [2, 4])
def test_other_rows_than_are_said_are_refused(rows: int) -> None:
    with pytest.raises(DatasetError, match=f"expected {rows} rows, found 3"):
        open_parquet_file(Path("a"), data=WHOLE, rows=rows, error=DatasetError)


def test_too_many_rows_values_and_words_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SourceError, match="3 rows; expected at most 2"):
        open_parquet_file(Path("a"), data=WHOLE, most=2)
    monkeypatch.setattr(parquet, "MAX_VALUES", 9)
    with pytest.raises(SourceError, match="a row group of 3 rows and 13 values"):
        open_parquet_file(Path("a"), data=WHOLE)


def test_one_long_word_many_times_is_refused_before_it_is_unpacked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    word = "w" * 1000
    tables = (
        pa.table({"few": ["a"] * 5000, "words": [word] * 5000}),
        pa.table({"words": [[{"of": word}] * 5000]}),
    )
    # pyarrow 17 repeats the long word in the statistics
    many, nested = (encode(table, statistics=False) for table in tables)
    assert len(many) + len(nested) < 10_000
    for data, bytes_ in ((many, 5_000_000), (nested, 5_000_000)):
        monkeypatch.setattr(parquet, "MAX_TEXT", bytes_)
        open_parquet_file(Path("a"), data=data).close()
        monkeypatch.setattr(parquet, "MAX_TEXT", bytes_ - 1)
        with pytest.raises(SourceError, match=r"the words of words.* more than 4,999,999 bytes"):
            open_parquet_file(Path("a"), data=data)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    for place, said in (
        (tmp_path / "none", "cannot be read"),
        (tmp_path, "is no file"),
        (Path("/dev/zero"), "is no file"),
    ):
        with pytest.raises(SourceError, match=said):
            open_parquet_file(place)


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, len(WHOLE) - 1),
    st.integers(0, 255),
    st.integers(0, len(WHOLE)),
)
def test_damage_anywhere_is_one_error(place: int, byte: int, end: int) -> None:
    data = bytearray(WHOLE)
    data[place] = byte
    for damaged in (bytes(data), bytes(data[:end])):
        try:
            with reading_parquet(Path("a.parquet"), data=damaged) as file:
                words_of(file.schema_arrow)
                file.read(use_threads=False).validate(full=True)
        except SourceError:
            pass


def test_metadata_that_is_no_text_has_marks_in_it() -> None:
    schema = pa.schema([], {b"\xff": b"a\xfe"})
    assert words_of(schema) == {"\N{REPLACEMENT CHARACTER}": "a\N{REPLACEMENT CHARACTER}"}
