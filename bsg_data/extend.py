"""What sources, masks and exports of others need, and programs that go below the public names.

`extend.pyi` lists the names. Each is imported on first use.
"""

from bsg_data.public_names import read_stub

__getattr__, __all__ = read_stub(__name__, __file__)


def __dir__() -> list[str]:
    """Return the names."""
    return __all__
