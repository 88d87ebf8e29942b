"""Beliefs: what follows from the facts of `bsg_data`. Needs a dataset, never HM3D itself.

The public names are in `__init__.pyi`. Each is imported when it is first asked for, so that
`import bsg_models` does not wait for torch.
"""

import warnings
from typing import Any

from bsg_data.errors import EXTRA_OF, ask_to_install
from bsg_data.public_names import read_stub

# torch-geometric 2.8 calls it at import, and torch 2.15 warns of that. The warning names a file of
# torch's, so a program's own call is not told apart. A filter of the user's goes first.
warnings.filterwarnings(
    "ignore", "`torch.jit.script` is deprecated", category=FutureWarning, append=True
)
_load, __all__ = read_stub(__name__, __file__)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__


def __getattr__(name: str) -> Any:
    """Import a public name."""
    try:
        return _load(name)
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in ("", "bsg_data", "bsg_models"):
            raise
        extra = "onnx" if EXTRA_OF.get(missing) == "onnx" else "train"  # whatever it lacks first
        raise ModuleNotFoundError(
            f"{missing} is not installed; bsg_models needs it: {ask_to_install(extra)}",
            name=error.name,
        ) from error
