"""Read parquet of others: any damage is one error; rows and what they unpack to have bounds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounded_file import Refusal
from bsg_data.inputs.bounds import MIB
from bsg_data.inputs.parquet_pages import measure_pages

# What Arrow raises for bytes that are no parquet of ours: UnicodeDecodeError is a ValueError.
_DAMAGE = (
    *(OSError, pa.ArrowException, KeyError, IndexError, TypeError, ValueError, OverflowError),
    *(MemoryError, RecursionError),
)


def open_parquet_file(
    path: Path,
    *,
    most: int,
    bound: int,
    is_read: Callable[[str], bool] = bool,
    dictionaries: Sequence[str] = (),
    error: Refusal = SourceError,
) -> pq.ParquetFile:
    """Open a parquet file of which some columns have at most so many rows and bytes, unpacked.

    Args:
        path: of the file.
        most: rows.
        bound: of the bytes that the columns take.
        is_read: whether the column of a name is read; all that have one, by default.
        dictionaries: columns of words that repeat.
        error: raised for what is refused.
    """
    with refusing_damage(path, error=error):
        if not path.is_file() and path.exists():
            raise OSError("it is no file")  # a device may have no end
        with path.open("rb") as data:
            rows, size = measure_pages(data, is_read)
        if size > bound:
            raise error(
                f"{path}: expected at most {bound:,} bytes, unpacked, found {size:,}",
                code="file-too-large",
                where=path,
            )
        if rows > most:
            message = f"{path}: expected at most {most:,} rows, found {rows:,}"
            raise error(message, code="parquet-rows", where=path)
        held = pq.read_schema(path).names
        words = [name for name in dictionaries if name in held]
        return pq.ParquetFile(path, read_dictionary=words, buffer_size=MIB)


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
