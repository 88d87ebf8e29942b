"""Define the errors of `bsg_robot`; `bsg_data.errors` shows the tree of all errors."""

from __future__ import annotations

from bsg_data.errors import BSGError


class BeliefFileError(BSGError):
    """Report a belief graph that cannot be read or written."""


class HydraError(BeliefFileError):
    """Report a Spark-DSG file that cannot be read or written."""
