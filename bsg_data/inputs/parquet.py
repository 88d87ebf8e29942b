"""Read parquet of others: any damage is one error; rows and what they unpack to have bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounded_file import Refusal
from bsg_data.inputs.bounds import MAX_RATIO, MIB

UNSUSPICIOUS = 256 * MIB  # unpacked, before a ratio is judged
# What Arrow raises for bytes that are no parquet of ours: UnicodeDecodeError is a ValueError.
_DAMAGE = (OSError, pa.ArrowException, KeyError, IndexError, TypeError, ValueError, OverflowError)


def open_parquet_file(
    path: Path, *, most: int, dictionaries: Sequence[str] = (), error: Refusal = SourceError
) -> pq.ParquetFile:
    """Open a parquet file of at most so many rows; dictionaries are columns of repeated words."""
    with refusing_damage(path, error=error):
        file = pq.ParquetFile(path, read_dictionary=list(dictionaries))
    found = file.metadata.num_rows
    if found > most:
        file.close()
        message = f"{path}: expected at most {most:,} rows, found {found:,}"
        raise error(message, code="parquet-rows", where=path)
    if _unpacked_size(file.metadata) > max(UNSUSPICIOUS, MAX_RATIO * path.stat().st_size):
        file.close()
        raise error(
            f"{path}: unpacks to more than {MAX_RATIO} times its size; write it as .csv, if it is "
            "what it should be",
            code="file-packed-too-well",
            where=path,
        )
    return file


def _unpacked_size(said: pq.FileMetaData) -> int:
    """Return the bytes of all columns in memory, if none is a list.

    What a damaged file says of single columns ends the process in Arrow.
    """
    groups = map(said.row_group, range(said.num_row_groups))
    sizes: list[int] = [group.total_byte_size for group in groups]
    return sum(sizes) + 8 * int(said.num_rows * said.num_columns)


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
