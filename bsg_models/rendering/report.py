"""Write an evaluation as one page: results, the paper's figures, and an explorer of buildings."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bsg_data.files import write_bytes
from bsg_models.rendering.pages import render_page


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the report: caption, header and rows of text."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


def write_report(
    path: Path,
    *,
    title: str,
    facts: Sequence[str],
    findings: Mapping[str, Mapping[str, Sequence[str]]],
    tables: Sequence[Table],
    figures: Mapping[str, Path],
    explorer: str | None,
) -> None:
    """Write the self-contained page with all text escaped. A failed write leaves no partial file.

    Args:
        path: file to write.
        title: its heading.
        facts: what was measured and on which buildings, a paragraph each.
        findings: heading → verdict → the metrics with that verdict.
        tables: of metrics; those after the first are folded.
        figures: caption → PNG file.
        explorer: page of `explorer_page`, shown in a frame; None for none.
    """
    page = render_page(
        "report.html.jinja",
        title=title,
        facts=facts,
        findings=findings,
        tables=tables,
        figures={
            caption: base64.b64encode(image.read_bytes()).decode()
            for caption, image in figures.items()
        },
        explorer=explorer,
    )
    write_bytes(path, page.encode())
