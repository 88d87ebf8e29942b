"""Format the results of a search study: a table for each world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import bsg_models
from bsg_data.tables import format_text


def format_results(results: Sequence[bsg_models.WorldResult]) -> Iterator[str]:
    """Yield a table of 80 characters for each world; the results are sorted by world."""
    for table in bsg_models.tabulate_savings(results):
        yield f"{table.caption}\n{format_text(table.rows, header=table.header)}"
