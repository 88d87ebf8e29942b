"""What the pages of parquet unpack to, by what Arrow was given to write."""

from __future__ import annotations

import io
from collections.abc import Callable

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.inputs import parquet_pages
from bsg_data.inputs.parquet_pages import measure_pages


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.text(max_size=40), max_size=300),
    st.integers(0, 20),
    st.sampled_from(["none", "zstd", "snappy"]),
    st.sampled_from(["1.0", "2.0"]),
)
def test_the_size_of_all_values_is_found_however_they_are_packed(
    names: list[str], columns: int, packed: str, version: str
) -> None:
    kinds = [pa.field(f"c{number}", pa.int64(), nullable=False) for number in range(columns)]
    schema = pa.schema([pa.field("name", pa.string(), nullable=False), *kinds])
    values = [pa.array(names, pa.string()), *[pa.array(range(len(names)), pa.int64())] * columns]
    sink = io.BytesIO()
    pq.write_table(
        pa.table(values, schema=schema),
        sink,
        compression=packed,
        use_dictionary=False,
        row_group_size=97,
        data_page_size=256,
        data_page_version=version,
    )
    texts = sum(4 + len(name.encode()) for name in names)
    size = texts + 8 * columns * len(names)
    found = measure_pages(sink)
    assert found.rows == len(names)
    # A page that packs badly takes more packed.
    assert found.size == size if packed == "none" else found.size >= size
    assert measure_pages(sink, lambda name: name == "c0").size <= found.size


def test_pages_that_are_too_large_or_too_many_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    sink = io.BytesIO()
    words = pa.table({"name": [f"{number:09}" for number in range(1_000)]})
    pq.write_table(words, sink, use_dictionary=False)
    size = 1_000 * (4 + 9)  # lengths and letters
    assert size < measure_pages(sink).size < size + 10  # and which are null
    for name, most in (("MAX_PAGES", 0), ("MAX_PAGE", size), ("MAX_INDEX", 99)):
        with monkeypatch.context() as bound:
            bound.setattr(parquet_pages, name, most)
            with pytest.raises(ValueError, match=r"more|fewer|expected"):
                measure_pages(sink)


def test_headers_of_pages_have_a_bound_together(monkeypatch: pytest.MonkeyPatch) -> None:
    sink = io.BytesIO()
    words = pa.table({"name": ["a" * 1_000] * 100})  # each twice in the header of its page
    options = {"use_dictionary": False, "write_batch_size": 1, "data_page_size": 1}
    pq.write_table(words, sink, **options)
    monkeypatch.setattr(parquet_pages, "MAX_HEADERS", 100 * 2_100)
    measure_pages(sink)
    monkeypatch.setattr(parquet_pages, "MAX_HEADERS", 100 * 2_000)
    with pytest.raises(ValueError, match="over 200,000 bytes of headers of pages; write larger"):
        measure_pages(sink)


def change_index(file: io.BytesIO, change: Callable[[bytes], bytes]) -> io.BytesIO:
    data = file.getvalue()
    at = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    index = change(data[at:-8])
    return io.BytesIO(data[:at] + index + len(index).to_bytes(4, "little") + b"PAR1")


# What Arrow reads in another way than a reader that is less strict.
LIES = {
    "nested more than 16 deep": lambda _: b"\x19" * 5_000,  # a list of one list of one list …
    "a field twice": lambda index: index[:-1] + b"\x06\x06\x00\x00",  # the rows, again
    "2 rows, but 1,000": lambda index: index.replace(b"\x16\xd0\x0f", b"\x16\x04", 1),
    "more than 64 bits": lambda index: index[:-1] + b"\x06\x40" + b"\xff" * 10 + b"\x00",
    "a record without an end": lambda index: index[:-1],
    "field 4 is missing": lambda index: index[:1] + b"\x02\x26\x02\x00",
    "its field 4 of kind 6": lambda index: index[:1] + b"\x02\x26\x02\x16\x02\x00",
    "more columns than its schema": lambda index: index.replace(b"schema\x15\2", b"schema\x15\0"),
    "a value of kind 13": lambda index: index[:-1] + b"\x0d\x40\x00\x00",
}


@pytest.mark.parametrize("said", LIES)
def test_an_index_that_could_be_read_in_two_ways_is_refused(said: str) -> None:
    sink = io.BytesIO()
    pq.write_table(pa.table({"name": [str(number) for number in range(1_000)]}), sink)
    with pytest.raises(ValueError, match=said):
        measure_pages(change_index(sink, LIES[said]))


WORD = pa.DictionaryArray.from_arrays(pa.array([0, 0], pa.int32()), ["a" * (17 * 2**20)])
COSTLY = {
    "delta encoding": (
        pa.table({"name": ["a"]}),
        {"use_dictionary": False, "column_encoding": {"name": "DELTA_BYTE_ARRAY"}},
    ),
    "values of 300 bytes": (pa.table({"name": pa.array([b"a" * 300], pa.binary(300))}), {}),
    "more than 1,000 columns": (pa.table({f"c{number}": [0] for number in range(1_001)}), {}),
    "bytes of dictionaries": (pa.table({"name": WORD}), {"dictionary_pagesize_limit": 2**30}),
}


@pytest.mark.parametrize("said", COSTLY)
def test_what_unpacks_beyond_its_pages_is_refused(said: str) -> None:
    table, options = COSTLY[said]
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd", **options)
    with pytest.raises(ValueError, match=said):
        measure_pages(sink)


def test_columns_that_are_not_read_may_be_anything() -> None:
    sink = io.BytesIO()
    pq.write_table(pa.table({"note": WORD, "x": [1, 2]}), sink, dictionary_pagesize_limit=2**30)
    assert measure_pages(sink, lambda name: name == "x").size < 100
