"""A figure as a file: drawn beside its place, so that no half of an image is ever there."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from bsg_data.errors import BSGError
from bsg_data.files import open_beside


class Drawing(Protocol):
    """What can be drawn into a file: a figure of matplotlib, which this package may lack."""

    def savefig(self, fname: Any, **how: Any) -> None:
        """Draw it."""


def write_figure(figure: Drawing, path: Path, **how: Any) -> None:
    """Draw a figure beside its place and rename it there; what was there stays until then.

    Args:
        figure: of matplotlib.
        path: its suffix names the format.
        how: as `savefig` takes it.

    Raises:
        BSGError: if the suffix names no format, or the file cannot be written.
    """
    if not path.suffix:  # matplotlib would take another path
        raise BSGError(f"{path}: no suffix names the format of the figure; take {path}.png")
    try:
        with open_beside(path) as partial:
            figure.savefig(partial, format=path.suffix[1:], **how)
    except (ValueError, RuntimeError) as error:  # it lists what it knows; .pgf needs LaTeX
        raise BSGError(f"{path}: the figure cannot be written ({error})") from error
