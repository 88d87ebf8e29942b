"""Read parquet of others: any damage is one error."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow as pa

from bsg_data.errors import BSGError, SourceError
from bsg_data.inputs.bounded_file import Refusal

# What Arrow raises for bytes that are no parquet of ours: UnicodeDecodeError is a ValueError.
_DAMAGE = (
    *(OSError, pa.ArrowException, KeyError, IndexError, TypeError, ValueError, OverflowError),
    *(MemoryError, RecursionError),
)


@contextmanager
def refusing_damage(path: Path, *, error: Refusal = SourceError) -> Iterator[None]:
    """Turn whatever Arrow raises for a file within a block into one error."""
    try:
        yield
    except BSGError:  # of whoever reads within the block; some are a ValueError, too
        raise
    except _DAMAGE as fault:
        reason = getattr(fault, "strerror", None) or " ".join(str(fault).split())[:300]
        message = f"{path}: expected parquet ({reason})"
        raise error(message, code="parquet-unreadable", where=path) from fault
