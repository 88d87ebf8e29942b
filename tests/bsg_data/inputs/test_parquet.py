"""Parquet of others: bounded in rows, and damaged in any way one error."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import DatasetError, SourceError
from bsg_data.inputs.bounds import MIB
from bsg_data.inputs.parquet import open_parquet_file, refusing_damage

TABLE = pa.table({"name": ["chair", "bed", None], "list": [[1.0], [], [2.0, 3.0]]})


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("parquet") / "a.parquet"
    pq.write_table(TABLE, path)
    return path


def test_no_more_rows_are_read_than_expected(path: Path) -> None:
    with open_parquet_file(path, most=3, bound=MIB) as file:
        assert file.read() == TABLE
    with refuses(DatasetError, "parquet-rows", path):
        open_parquet_file(path, most=2, bound=MIB, error=DatasetError)
    with refuses(SourceError, "parquet-unreadable", path.parent, golden=False):
        open_parquet_file(path.parent, most=3, bound=MIB)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 255), st.integers(0, 10**6))
def test_damage_anywhere_is_one_error(path: Path, place: int, byte: int, end: int) -> None:
    data = bytearray(path.read_bytes())
    data[place % len(data)] = byte
    damaged = path.with_name("damaged.parquet")
    for content in (bytes(data), bytes(data[: end % len(data)])):
        damaged.write_bytes(content)
        with (
            suppress(SourceError),
            open_parquet_file(damaged, most=99, bound=MIB) as file,
            refusing_damage(damaged),
        ):
            file.read(use_threads=False).validate(full=True)
