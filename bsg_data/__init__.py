"""Read, build, mask, split, check and store datasets of 3D scene graphs; never imports torch.

`__init__.pyi` lists the public names. Each is imported on first use.
"""

from bsg_data.public_names import read_stub

__getattr__, __all__ = read_stub(__name__, __file__)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
