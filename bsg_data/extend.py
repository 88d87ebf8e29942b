"""What sources, masks and exports of others need, and programs that go below the public names.

`extend.pyi` lists the names. Each is imported on first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("bsg_data", __file__)
