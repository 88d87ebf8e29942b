"""Answers to robots: what `bsg_data` knows and `bsg_models` believes, asked about a robot's map.

The public names are in `__init__.pyi`. Each is imported when it is first asked for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
