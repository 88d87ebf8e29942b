"""Beliefs: what follows from the facts of `bsg_data`. Needs a dataset, never HM3D itself.

The public names are in `__init__.pyi`. Each is imported when it is first asked for, so that
`import bsg_models` does not wait for torch.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
