"""Let matplotlib read no settings from the working folder while a command runs.

matplotlib reads a file `matplotlibrc` from the working folder when it is imported. The folder may
hold files of a stranger: settings that no figure can be drawn with, or a pipe that never ends.
Figures of a command therefore have matplotlib's own settings, or those that MATPLOTLIBRC names.
Programs that use the libraries keep their settings.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

_FILE, _FOLDER, _BACKEND = "MATPLOTLIBRC", "MPLCONFIGDIR", "MPLBACKEND"  # matplotlib reads these


def keep_from_working_folder() -> MetaPathFinder:
    """Let matplotlib read nothing from the working folder when it is imported later.

    Returns:
        The finder that sees to it, which is now the first of `sys.meta_path`.
    """
    os.environ[_BACKEND] = "agg"  # it draws files without a screen, and is always installed
    finder = _Finder()
    sys.meta_path.insert(0, finder)
    return finder


@contextmanager
def kept_from_working_folder() -> Iterator[None]:
    """Let matplotlib read nothing from the working folder if the block imports it."""
    before = os.environ.get(_BACKEND)
    finder = keep_from_working_folder()
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        _set(_BACKEND, before)


class _Finder(MetaPathFinder):
    """Find matplotlib as usual, and let it be imported in another working folder."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return where matplotlib is; None for any other module."""
        spec = PathFinder.find_spec(name, path, target) if name == "matplotlib" else None
        if spec is None or spec.loader is None or spec.origin is None:
            return None
        run, own = spec.loader.exec_module, Path(spec.origin).with_name("mpl-data")

        def run_elsewhere(module: ModuleType) -> None:
            with _elsewhere(own):
                run(module)

        setattr(spec.loader, "exec_module", run_elsewhere)  # noqa: B010 -- of this loader alone
        return spec


@contextmanager
def _elsewhere(own: Path) -> Iterator[None]:
    """Run the block in the root folder; the settings are those of `own`, or of the user."""
    try:
        here = Path.cwd()
    except FileNotFoundError:  # the working folder was removed, so it holds no settings
        yield
        return
    before = {name: os.environ.get(name) for name in (_FILE, _FOLDER)}
    for name, said in before.items():
        if said:  # a path of the user is meant from here
            os.environ[name] = str(here / said)
    if not before[_FILE]:
        os.environ[_FILE] = str(own)
    os.chdir(here.root)
    try:
        yield
    finally:
        os.chdir(here)
        for name, said in before.items():
            _set(name, said)


def _set(name: str, value: str | None) -> None:
    """Set a variable of the environment; None removes it."""
    if value is None:
        os.environ.pop(name, None)
    else:
        os.environ[name] = value
