"""Compile loops with numba, and let numba read nothing from the working folder.

numba reads a file `.numba_config.yaml` from the working folder, which can name a folder of compiled
functions. These are pickles, and opening one runs code. The working folder may hold a stranger's
files, so numba is not imported beside such a file and never looks for one afterwards.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from bsg_data.errors import BSGError

CONFIG = ".numba_config.yaml"


def refuse_config(folder: Path) -> None:
    """Refuse to import numba beside its configuration file.

    Raises:
        BSGError: naming the file and what to do.
    """
    if (folder / CONFIG).exists() or (folder / CONFIG).is_symlink():
        raise BSGError(
            f"{folder / CONFIG}: numba would read this file, and it can make numba run code; "
            "remove it, or run in another folder (environment variables NUMBA_… work)"
        )


if "numba" not in sys.modules:  # else somebody else imported it, and it was read
    refuse_config(Path.cwd())

import numba  # noqa: E402 -- not before the check
from numba.core import config  # noqa: E402

config._config_fname = ""  # it looks again whenever it compiles, perhaps in another folder


def has_home() -> bool:
    """Say whether the user has a home; without one, numba would make a folder `~` here."""
    try:
        return Path("~").expanduser().is_absolute()
    except RuntimeError:  # neither HOME nor an entry among the users
        return False


def compiled(*, nogil: bool = False) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a function when it is first called.

    The compiled function is kept between runs, beside the package or in the user's cache.

    Args:
        nogil: whether it may run beside other threads of Python.
    """
    keep = bool(config.CACHE_DIR) or has_home()
    return cast(Callable[[Callable[..., Any]], Any], numba.njit(cache=keep, nogil=nogil))
