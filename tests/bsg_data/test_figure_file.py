from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from bsg_data.errors import BSGError
from bsg_data.files import FigureError, noting_failures, write_figure


class Cut:
    """A figure whose drawing ends in the middle, as on a full disk."""

    def savefig(self, fname: Any, **how: Any) -> None:
        Path(fname).write_bytes(b"half")
        raise OSError(28, "No space left on device")


def test_the_suffix_names_the_format(tmp_path: Path) -> None:
    write_figure(Figure(), tmp_path / "a.png")
    write_figure(Figure(), tmp_path / "new" / "a.pdf")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "new" / "a.pdf").read_bytes().startswith(b"%PDF")


def test_what_was_there_stays_if_drawing_fails(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"old")
    with pytest.raises(BSGError, match=r"a\.png: cannot be written \(No space left"):
        write_figure(Cut(), path)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.png"]


def test_a_format_that_needs_a_program_is_refused(tmp_path: Path) -> None:
    class Lacking:
        """A figure as .pgf, where there is no LaTeX."""

        def savefig(self, fname: Any, **how: Any) -> None:
            raise RuntimeError("xelatex not found")

    with pytest.raises(FigureError, match=r"a\.pgf: the figure cannot be written \(xelatex"):
        write_figure(Lacking(), tmp_path / "a.pgf")
    notes: list[str] = []
    with noting_failures(notes):
        write_figure(Lacking(), tmp_path / "a.pgf")
    (note,) = notes
    assert note.startswith("note: a figure is missing: ")
    with pytest.raises(BSGError, match="cannot be written"), noting_failures(notes):
        write_figure(Cut(), tmp_path / "a.png")  # a full disk is no fault of the figure


@pytest.mark.parametrize(("name", "said"), [("a", "take .*a.png"), ("a.doc", "a.doc: the figure")])
def test_a_suffix_that_names_no_format_is_refused(tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(BSGError, match=said):
        write_figure(Figure(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []
