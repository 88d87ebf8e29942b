"""Read, build, mask, split, check and store datasets of 3D scene graphs; never imports torch.

`__init__.pyi` lists the public names. Each is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
