"""Answers to robots: what `bsg_data` knows and `bsg_models` believes, asked about a robot's map.

The public names are in `__init__.pyi`. Each is imported when it is first asked for.
"""

from bsg_data.public_names import read_stub

__getattr__, __all__ = read_stub(__name__, __file__)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
