"""Beliefs: what follows from the facts of `bsg_data`. Needs a dataset, never HM3D itself.

The public names are in `__init__.pyi`. Each is imported when it is first asked for, so that
`import bsg_models` does not wait for torch.
"""

import importlib
import warnings
from typing import Any

import lazy_loader

# torch-geometric 2.8 calls it at import, and torch 2.15 warns of that. The warning names a file of
# torch's, so a program's own call is not told apart. A filter of the user's goes first.
warnings.filterwarnings(
    "ignore", "`torch.jit.script` is deprecated", category=FutureWarning, append=True
)
_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_OF_ROBOTS = ("open_graph", "write_belief")  # what people ask first is found here, too
__all__ = sorted((*__all__, *_OF_ROBOTS))


def __getattr__(name: str) -> Any:
    """Return a public name; nothing in this package imports bsg_robot."""
    return (
        getattr(importlib.import_module("bsg_robot"), name) if name in _OF_ROBOTS else _load(name)
    )
