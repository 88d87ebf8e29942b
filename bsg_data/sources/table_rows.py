"""Read the rows of tables: CSV, tab-separated (both also gzipped) and parquet."""

from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import open_stream
from bsg_data.inputs.bounds import MAX_LINE, MAX_OBJECT_ROWS, TABLE
from bsg_data.inputs.parquet import reading_parquet

SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".parquet")
_REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")


@dataclass(frozen=True, slots=True)
class Cells:
    """One row of a table.

    Attributes:
        file: that it is of.
        place: `line 12` of a CSV file, whose header is line 1; `row 11` of parquet, from 1.
        values: column → what stands there.
    """

    file: Path
    place: str
    values: Mapping[str, Any]

    def text(self, column: str, *, limit: int = MAX_LINE) -> str:
        """Return what stands in a column, without spaces around it; empty where nothing does.

        Raises:
            SourceError: for more than `limit` characters.
        """
        value = self.values.get(column)
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return ""
        if isinstance(value, float) and value.is_integer():
            value = int(value)  # as Pandas gives whole numbers when one is missing
        if isinstance(value, bytes | dict):
            raise self.fault(column, "text or a number", value)
        parts = [value] if not isinstance(value, list) else [v for v in value if v is not None]
        text = ";".join(map(str, parts)).strip()
        if len(text) > limit:
            raise self.fault(column, f"at most {limit} characters", text[:40] + "…")
        return text

    def number(self, column: str, *, limit: float) -> float | None:
        """Return the number in a column, None where nothing stands.

        Raises:
            SourceError: for what is no finite number of at most `limit` and no less than its
                negative.
        """
        text = self.text(column)
        if not text:
            return None
        value = float(text) if _REAL.fullmatch(text) else math.inf
        if not abs(value) <= limit:
            raise self.fault(column, f"a number from {-limit:g} to {limit:g}, with a point", text)
        return value

    def fault(self, column: str, expected: str, found: object) -> SourceError:
        """Return an error that names the file, the row and the column."""
        return SourceError(
            f"{self.file}, {self.place}, column {column}: expected {expected}, found {found!r}"
        )


@dataclass(frozen=True, slots=True)
class CellTable:
    """A table in a file.

    Attributes:
        columns: of the file, in their order.
        unread: those of them that nobody asked for.
        rows: read while one goes through them.
    """

    columns: tuple[str, ...]
    unread: tuple[str, ...]
    rows: Iterator[Cells]


def read_cells(file: Path, *, known: Sequence[str]) -> CellTable:
    """Read a table, of its columns those that are known.

    Raises:
        SourceError: naming the file and the row; also while the rows are read.
    """
    name = file.name.casefold()
    if not name.endswith(SUFFIXES):
        raise SourceError(f"{file}: expected a file that ends in {', '.join(SUFFIXES)}")
    rows = _read_parquet(file, known) if name.endswith(".parquet") else _read_csv(file)
    try:
        columns = next(rows)
    except StopIteration:
        raise SourceError(f"{file}: is empty; expected a header with the columns' names") from None
    names = tuple(str(column).strip() for column in columns)
    twice = [column for column, times in Counter(names).items() if times > 1]
    if twice:
        raise SourceError(f"{file}: the column {min(twice)!r} is there twice")
    unread = tuple(column for column in names if column not in known)
    return CellTable(names, unread, _name_cells(file, names, rows))


def _name_cells(file: Path, names: tuple[str, ...], rows: Iterator[Any]) -> Iterator[Cells]:
    for count, (place, values) in enumerate(rows):
        if count >= MAX_OBJECT_ROWS:
            raise SourceError(
                f"{file}: over {MAX_OBJECT_ROWS:,} rows; split it into several tables"
            )
        if isinstance(values, dict):
            yield Cells(file, place, values)
        elif len(values) == len(names):
            yield Cells(file, place, dict(zip(names, values, strict=True)))
        else:
            raise SourceError(
                f"{file}, {place}: expected {len(names)} fields, as many as the header has; found "
                f"{len(values)}"
            )


def _read_csv(file: Path) -> Iterator[Any]:
    """Yield the header, then the place and the fields of every line that is not empty."""
    number = 0

    def refuse(said: str, **place: Any) -> SourceError:
        where = f", line {number + 1} or later" if number else ""
        return SourceError(f"{file}{where}{said.removeprefix(str(file))}", **place)

    try:
        with open_stream(file, TABLE, error=refuse) as opened:
            text = io.TextIOWrapper(opened, encoding="utf-8-sig", newline="")
            reader = csv.reader(
                _limit(text, file),
                strict=True,
                delimiter="\t" if ".tsv" in file.name.casefold() else ",",
            )
            header = next(reader, None)
            if header is None:
                return
            yield header
            for fields in reader:
                number = reader.line_num
                if any(field.strip() for field in fields):
                    yield f"line {number}", fields
    except UnicodeDecodeError as error:
        raise SourceError(f"{file}, line {number + 1} or later: expected UTF-8 text") from error
    except csv.Error as error:
        raise SourceError(
            f"{file}, line {number + 1} or later: cannot be read ({error})"
        ) from error


def _limit(opened: io.TextIOWrapper, file: Path) -> Iterator[str]:
    number = 0
    while line := opened.readline(MAX_LINE + 1):
        number += 1
        if len(line) > MAX_LINE:
            raise SourceError(f"{file}, line {number}: over {MAX_LINE:,} characters")
        if number > 2 * MAX_OBJECT_ROWS:
            raise SourceError(f"{file}: over {number:,} lines, most of them empty")
        yield line


def _read_parquet(file: Path, known: Sequence[str]) -> Iterator[Any]:
    """Yield the names of the columns, then the place and the values of every row."""
    with reading_parquet(file) as opened:
        names = opened.schema_arrow.names
        yield names
        number = 0
        for batch in opened.iter_batches(columns=[name for name in names if name in known]):
            batch.validate(full=True)
            for row in batch.to_pylist():
                number += 1
                yield f"row {number}", row
