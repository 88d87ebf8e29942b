"""Footers of parquet are read as Arrow reads them, and damage is one error, not an end."""

from __future__ import annotations

import io

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.inputs.parquet_footer import read_footer


def encode(rows: int, *, size: int) -> bytes:
    table = pa.table(
        {
            "word": [f"w{n % 3}" for n in range(rows)],
            "list": [[1.0] * (n % 4) for n in range(rows)],
            "flag": [n % 2 == 0 for n in range(rows)],
            "pair": [{"a": n, "b": None} for n in range(rows)],
        }
    )
    buffer = io.BytesIO()
    pq.write_table(table, buffer, row_group_size=size)
    return buffer.getvalue()


@pytest.mark.parametrize(("rows", "size"), [(1, 1), (7, 3), (40, 2)])
def test_a_footer_says_what_arrow_reads_in_it(rows: int, size: int) -> None:
    data = encode(rows, size=size)
    footer, known = read_footer(io.BytesIO(data)), pq.ParquetFile(pa.BufferReader(data)).metadata
    assert footer.rows == known.num_rows == rows
    assert len(footer.groups) == known.num_row_groups
    for number, group in enumerate(footer.groups):
        theirs = known.row_group(number)
        assert group.rows == theirs.num_rows
        for k, column in enumerate(group.columns):
            chunk = theirs.column(k)
            assert column.path == chunk.path_in_schema
            assert column.values == chunk.num_values
            assert column.bytes == chunk.total_uncompressed_size
            assert column.is_text == (chunk.physical_type == "BYTE_ARRAY")


def test_a_table_of_nothing_has_a_footer() -> None:
    buffer = io.BytesIO()
    pq.write_table(pa.table({"a": pa.array([], pa.int8())}), buffer)
    assert read_footer(buffer).rows == 0


@pytest.mark.parametrize("data", [b"", b"PAR1", b"PAR1" * 3, b"x" * 20 + b"\xff\xff\xff\xffPAR1"])
def test_what_is_no_parquet_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"parquet|malformed|footer"):
        read_footer(io.BytesIO(data))


WHOLE = encode(3, size=2)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(st.integers(4, len(WHOLE) - 9), st.integers(0, 255)), min_size=1, max_size=3)
)
def test_damage_is_a_value_error(changes: list[tuple[int, int]]) -> None:
    damaged = bytearray(WHOLE)
    for place, byte in changes:
        damaged[place] = byte
    try:
        footer = read_footer(io.BytesIO(bytes(damaged)))
    except ValueError:
        return
    assert sum(group.rows for group in footer.groups) == footer.rows
