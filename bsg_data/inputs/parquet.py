"""Read untrusted parquet: check what the footer asks for before any row is read.

A few kilobytes can describe 240 million rows, or one long word a million times. So rows, values and
text are counted first. Any damage is reported as one error.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounded_file import Refusal, open_waiting_for_none
from bsg_data.inputs.bounds import DATASET_TABLE, GIB, MAX_ROWS, MAX_VALUES
from bsg_data.inputs.parquet_footer import Footer, read_footer

MAX_TEXT = 2 * GIB  # bytes of the words of a column, each counted as often as it is there

# What Arrow raises for bytes that are no parquet of ours: UnicodeDecodeError is a ValueError.
DAMAGE = (OSError, pa.ArrowException, KeyError, IndexError, TypeError, ValueError, OverflowError)


def open_parquet_file(
    path: Path,
    *,
    data: bytes | None = None,
    rows: int | None = None,
    most: int = MAX_ROWS,
    dictionaries: Sequence[str] = (),
    error: Refusal = SourceError,
) -> pq.ParquetFile:
    """Open a parquet file, whose footer asks for no more than the bounds.

    Args:
        path: of the file, named in errors.
        data: its bytes, where they were read.
        rows: that it must have, where somebody says so.
        most: rows that it may have; a row group never has more than `MAX_ROWS`.
        dictionaries: columns of words that are read as numbers.
        error: makes what is raised of a message.

    Raises:
        SourceError: or what `error` makes, if it is not there, damaged or too large.
    """
    if data is None:
        require_regular(path, error=error)
    with refusing_damage(path, error=error):
        with open_waiting_for_none(path) if data is None else io.BytesIO(data) as bare:
            footer = read_footer(bare)
        _require_footer(path, footer, rows, most, error)
        _require_text(path, data, footer, error)
        source = path if data is None else pa.BufferReader(data)
        return pq.ParquetFile(source, read_dictionary=list(dictionaries))


@contextmanager
def reading_parquet(
    path: Path, *, error: Refusal = SourceError, **options: Any
) -> Iterator[pq.ParquetFile]:
    """Open a parquet file for a block, in which whatever Arrow raises is one error.

    Args:
        path: of the file, named in errors.
        error: makes what is raised of a message.
        options: of `open_parquet_file`.

    Raises:
        SourceError: or what `error` makes, if it is not there, damaged or too large.
    """
    with (
        open_parquet_file(path, error=error, **options) as file,
        refusing_damage(path, error=error),
    ):
        yield file


@contextmanager
def refusing_damage(path: Path, *, error: Refusal = SourceError) -> Iterator[None]:
    """Turn whatever Arrow raises for a file within a block into one error.

    Raises:
        SourceError: or what `error` makes.
    """
    try:
        yield
    except BSGError:  # of whoever reads within the block; some are a ValueError, too
        raise
    except DAMAGE as fault:
        said = getattr(fault, "strerror", None) or " ".join(str(fault).split())[:300]
        raise error(f"{path}: not readable as parquet ({said})") from fault


def require_regular(path: Path, *, error: Refusal = SourceError) -> None:
    """Refuse what is no file on a disk, in which alone parquet can be read, or is too large.

    Raises:
        SourceError: or what `error` makes.
    """
    try:
        size = path.stat().st_size
    except (OSError, ValueError) as fault:
        said = getattr(fault, "strerror", None) or fault
        raise error(f"{path}: cannot be read ({said})") from fault
    if not path.is_file():
        raise error(f"{path}: is no file; expected parquet")
    if size > DATASET_TABLE.bytes:
        raise error(f"{path}: {size:,} bytes; expected at most {DATASET_TABLE.bytes:,}")


def words_of(schema: pa.Schema) -> Mapping[str, str]:
    """Return the metadata of a schema as text; what is no UTF-8 has marks in it."""
    metadata = schema.metadata or {}
    return {
        key.decode("utf-8", "replace"): v.decode("utf-8", "replace") for key, v in metadata.items()
    }


def _require_footer(
    path: Path, footer: Footer, rows: int | None, most: int, error: Refusal
) -> None:
    if rows is not None and footer.rows != rows:
        raise error(f"{path}: expected {rows:,} rows, found {footer.rows:,}")
    if footer.rows > most:
        raise error(f"{path}: {footer.rows:,} rows; expected at most {most:,}")
    for group in footer.groups:
        values = sum(column.values for column in group.columns)
        if group.rows > MAX_ROWS or values > MAX_VALUES:
            raise error(
                f"{path}: a row group of {group.rows:,} rows and {values:,} values; expected "
                f"at most {MAX_ROWS:,} and {MAX_VALUES:,}"
            )


def _require_text(path: Path, data: bytes | None, footer: Footer, error: Refusal) -> None:
    """Refuse words that are packed into numbers and would unpack to more than memory holds."""
    for chunks in zip(*(group.columns for group in footer.groups), strict=True):
        column, longest = chunks[0], max(chunk.bytes for chunk in chunks)
        if not column.is_text or sum(chunk.values for chunk in chunks) * longest <= MAX_TEXT:
            continue  # even if one word had all bytes, and were in every row
        if _measure_text(path, data, column.path) > MAX_TEXT:
            raise error(
                f"{path}: the words of {column.path} have more than {MAX_TEXT:,} bytes; expected "
                "at most these"
            )


def _measure_text(path: Path, data: bytes | None, column: str) -> int:
    """Return how many bytes the words of a column have, which are read as numbers."""
    source = path if data is None else pa.BufferReader(data)
    total = 0
    with pq.ParquetFile(source, read_dictionary=[column]) as file:
        for batch in file.iter_batches(columns=[column], use_threads=False):
            total += sum(map(_measure_words, batch.columns))
    return total


def _measure_words(words: pa.Array) -> int:
    while isinstance(words, pa.ListArray | pa.LargeListArray | pa.StructArray):
        if isinstance(words, pa.StructArray):
            return sum(map(_measure_words, words.flatten()))
        words = words.flatten()
    if isinstance(words, pa.DictionaryArray):
        lengths = pc.binary_length(words.dictionary)
        return int(pc.sum(pc.take(lengths, words.indices)).as_py() or 0)
    return int(words.nbytes)
