"""Parquet of others: bounded in rows, and damaged in any way one error."""

from __future__ import annotations

import io
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import DatasetError, SourceError
from bsg_data.inputs.parquet import open_parquet_file, reading_parquet, words_of


def encode(table: pa.Table) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
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


@pytest.mark.parametrize("bound", [{"rows": 2}, {"rows": 4}, {"most": 2}])
def test_other_or_more_rows_than_expected_are_refused(bound: dict[str, int]) -> None:
    with refuses(DatasetError, "parquet-rows", "a"):
        open_parquet_file(Path("a"), data=WHOLE, error=DatasetError, **bound)


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    for place in (tmp_path / "none", tmp_path):
        with refuses(SourceError, "parquet-unreadable", place, golden=False):
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
