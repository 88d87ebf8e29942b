"""Write a figure beside its final path, then rename it; so no incomplete image appears."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Protocol

from bsg_data.errors import BSGError
from bsg_data.files import open_beside

# Settings of matplotlib for all figures: names are shown as they are, a $ as a $.
PLAIN_TEXT: Final[dict[Any, Any]] = {"text.usetex": False, "text.parse_math": False}


class FigureError(BSGError):
    """Report a figure that cannot be drawn, though its file could be written."""


class _Drawing(Protocol):
    """An object that can be drawn into a file, such as a figure of matplotlib."""

    def savefig(self, fname: Any, **how: Any) -> None:
        """Draw the object into a file."""


def write_figure(figure: _Drawing, path: Path, **how: Any) -> None:
    """Draw a figure beside its final path and rename it there; an old file stays until then."""
    if not path.suffix:  # matplotlib would take another path
        raise BSGError(f"{path}: no suffix names the format of the figure; take {path}.png")
    try:
        with open_beside(path) as partial:
            figure.savefig(partial, format=path.suffix[1:], **how)
    except (ValueError, RuntimeError) as error:  # it lists what it knows; .pgf needs LaTeX
        raise FigureError(f"{path}: the figure cannot be written ({error})") from error


@contextmanager
def noting_failures(notes: list[str]) -> Iterator[None]:
    """Add a note if the figure of the block cannot be drawn, so that finished work is kept."""
    try:
        yield
    except FigureError as error:
        notes.append(f"note: a figure is missing: {error}")
