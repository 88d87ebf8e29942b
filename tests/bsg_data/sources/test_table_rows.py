from __future__ import annotations

import gzip
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from bsg_data.errors import SourceError
from bsg_data.sources import table_rows
from bsg_data.sources.table_rows import read_cells

KNOWN = ("room", "x", "connected")


def read(path: Path) -> list[tuple[str, str, float | None, str]]:
    rows = read_cells(path, known=KNOWN).rows
    return [(c.place, c.text("room"), c.number("x", limit=100), c.text("connected")) for c in rows]


def test_the_same_rows_in_every_kind_of_file(tmp_path: Path) -> None:
    text = 'room,x,connected,colour\n"a ""b"", c",1.5,d;e,red\n\n 7 ,,,\n'
    (tmp_path / "t.csv").write_text(text, "utf-8-sig")
    (tmp_path / "t.csv.gz").write_bytes(gzip.compress(text.encode()))
    (tmp_path / "t.tsv").write_text('room\tx\tconnected\n"a ""b"", c"\t1.5\td;e\n\n7\t\t\n')
    expected = [("line 2", 'a "b", c', 1.5, "d;e"), ("line 4", "7", None, "")]
    for name in ("t.csv", "t.csv.gz", "t.tsv"):
        assert read(tmp_path / name) == expected
    assert read_cells(tmp_path / "t.csv", known=KNOWN).unread == ("colour",)
    columns = {"room": ['a "b", c', "7"], "x": [1.5, None], "connected": [["d", "e"], None]}
    pq.write_table(pa.table({**columns, "colour": ["red", None]}), tmp_path / "t.parquet")
    in_parquet = [("row 1", *expected[0][1:]), ("row 2", *expected[1][1:])]
    assert read(tmp_path / "t.parquet") == in_parquet
    assert read_cells(tmp_path / "t.parquet", known=KNOWN).unread == ("colour",)


def test_whole_numbers_that_pandas_made_real_are_names_of_rooms(tmp_path: Path) -> None:
    pd.DataFrame({"room": [3, None]}).to_parquet(tmp_path / "t.parquet")
    assert [room for _, room, _, _ in read(tmp_path / "t.parquet")] == ["3", ""]


@pytest.mark.parametrize("word", ["nan", "inf", "1e999", "1_000", "0x10", "abc", "101", "١"])
def test_what_is_no_number_is_refused_by_line_and_column(tmp_path: Path, word: str) -> None:
    (tmp_path / "t.csv").write_text(f"room,x\n1,2\n1,{word}\n", "utf-8")
    expected = "t.csv, line 3, column x: expected a number from -100 to 100, with a point, "
    expected += f"found '{word}'"
    with pytest.raises(SourceError, match=expected):
        read(tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", "is empty"),
        (b"room,x,room\n", "'room' is there twice"),
        (b"room,x\n1,2,3\n", "line 2: expected 2 fields"),
        (b'room,x\n1,2\n1,"2\n', "line 3 or later: cannot be read"),
        (b"room,x\n1,\xff\n", "expected UTF-8"),
        (b"room,x\n1," + b"y" * 2**21, "line 2: over 1,048,576 characters"),
    ],
)
def test_malformed_text(tmp_path: Path, data: bytes, expected: str) -> None:
    (tmp_path / "t.csv").write_bytes(data)
    with pytest.raises(SourceError, match=expected):
        read(tmp_path / "t.csv")


def test_files_that_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SourceError, match=r"t.csv: cannot be read \(No such file"):
        read(tmp_path / "t.csv")
    with pytest.raises(SourceError, match=r"ends in \.csv"):
        read(tmp_path / "t.xlsx")
    (tmp_path / "t.parquet").write_bytes(b"PAR1")
    with pytest.raises(SourceError, match="not readable as parquet"):
        read(tmp_path / "t.parquet")
    whole = gzip.compress(b"room,x\n" + b"1,2\n" * 9999)
    (tmp_path / "t.csv.gz").write_bytes(whole[:-9])
    with pytest.raises(SourceError, match=r"line \d+ or later: cannot be read"):
        read(tmp_path / "t.csv.gz")
    monkeypatch.setattr(table_rows, "MAX_OBJECT_ROWS", 3)
    (tmp_path / "t.csv").write_text("room\n1\n2\n3\n4\n")
    with pytest.raises(SourceError, match="over 3 rows"):
        read(tmp_path / "t.csv")
