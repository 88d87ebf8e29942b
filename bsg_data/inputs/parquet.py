"""Read parquet of others: any damage is one error; rows and what they unpack to have bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounded_file import Refusal
from bsg_data.inputs.parquet_pages import measure_pages

# What Arrow raises for bytes that are no parquet of ours: UnicodeDecodeError is a ValueError.
_DAMAGE = (OSError, pa.ArrowException, KeyError, IndexError, TypeError, ValueError, OverflowError)


def open_parquet_file(
    path: Path,
    *,
    most: int,
    bound: int,
    dictionaries: Sequence[str] = (),
    error: Refusal = SourceError,
) -> pq.ParquetFile:
    """Open a parquet file of at most so many rows and bytes, as they unpack.

    Dictionaries are columns of words that repeat.
    """
    with refusing_damage(path, error=error):
        with path.open("rb") as data:
            size = measure_pages(data)
        if size > bound:
            raise error(
                f"{path}: expected at most {bound:,} bytes, unpacked, found {size:,}",
                code="file-too-large",
                where=path,
            )
        file = pq.ParquetFile(path, read_dictionary=list(dictionaries))
    found = file.metadata.num_rows
    if found > most:
        file.close()
        message = f"{path}: expected at most {most:,} rows, found {found:,}"
        raise error(message, code="parquet-rows", where=path)
    return file


@contextmanager
def refusing_damage(path: Path, *, error: Refusal = SourceError) -> Iterator[None]:
    """Turn whatever Arrow raises for a file within a block into one error."""
    try:
        yield
    except BSGError:  # of whoever reads within the block; some are a ValueError, too
        raise
    except _DAMAGE as fault:
        said = getattr(fault, "strerror", None) or " ".join(str(fault).split())[:300]
        message = f"{path}: not readable as parquet ({said})"
        raise error(message, code="parquet-unreadable", where=path) from fault
