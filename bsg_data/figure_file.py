"""Write a figure beside its final path, then rename it; so no incomplete image appears."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from bsg_data.errors import BSGError
from bsg_data.files import open_beside


class Drawing(Protocol):
    """An object that can be drawn into a file, such as a figure of matplotlib."""

    def savefig(self, fname: Any, **how: Any) -> None:
        """Draw the object into a file."""


def write_figure(figure: Drawing, path: Path, **how: Any) -> None:
    """Draw a figure beside its final path and rename it there; an old file stays until then.

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
