"""Read parquet with any damage as one error, and no more rows than a bound."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounded_file import Refusal
from bsg_data.inputs.bounds import MAX_ROWS

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
    """Open a parquet file.

    Args:
        path: of the file, named in errors.
        data: its bytes, where they were read.
        rows: that it must have, where somebody says so.
        most: rows that it may have.
        dictionaries: columns of words that are read as numbers.
        error: makes what is raised of a message.
    """
    with refusing_damage(path, error=error):
        source = path if data is None else pa.BufferReader(data)
        file = pq.ParquetFile(source, read_dictionary=list(dictionaries))
    found = file.metadata.num_rows
    if found > most or rows not in (None, found):
        file.close()
        expected = f"at most {most:,}" if rows is None else f"{rows:,}"
        raise error(
            f"{path}: expected {expected} rows, found {found:,}", code="parquet-rows", where=path
        )
    return file


@contextmanager
def reading_parquet(
    path: Path, *, error: Refusal = SourceError, **options: Any
) -> Iterator[pq.ParquetFile]:
    """Open a parquet file for a block, in which whatever Arrow raises is one error."""
    with (
        open_parquet_file(path, error=error, **options) as file,
        refusing_damage(path, error=error),
    ):
        yield file


@contextmanager
def refusing_damage(path: Path, *, error: Refusal = SourceError) -> Iterator[None]:
    """Turn whatever Arrow raises for a file within a block into one error."""
    try:
        yield
    except BSGError:  # of whoever reads within the block; some are a ValueError, too
        raise
    except DAMAGE as fault:
        said = getattr(fault, "strerror", None) or " ".join(str(fault).split())[:300]
        raise error(
            f"{path}: not readable as parquet ({said})", code="parquet-unreadable", where=path
        ) from fault


def words_of(schema: pa.Schema) -> Mapping[str, str]:
    """Return the metadata of a schema as text; what is no UTF-8 has marks in it."""
    metadata = schema.metadata or {}
    return {
        key.decode("utf-8", "replace"): v.decode("utf-8", "replace") for key, v in metadata.items()
    }
