"""An evaluation as one page: what was measured, the paper's figures, and buildings to look into."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from bsg_data.files import write_bytes


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the report: its caption, header and rows of text."""

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
    explorer: str,
) -> None:
    """Write the page, whole or not at all; everything is in it, and all text is escaped.

    Args:
        path: of the page.
        title: its heading.
        facts: what was measured on, a paragraph each.
        findings: heading → verdict → what it is of.
        tables: of metrics; those after the first are folded.
        figures: caption → PNG.
        explorer: page of `explorer_page`, shown in a frame.
    """
    parts = [f"<h1>{html.escape(title)}</h1>"]
    parts += [f"<p>{html.escape(fact)}</p>" for fact in facts]
    parts += ["<h2>Look into a building</h2>", _HOW]
    page = html.escape(explorer, quote=True)
    parts.append(f'<iframe title="explorer" srcdoc="{page}"></iframe>')
    for heading, verdicts in findings.items():
        parts += [f"<h2>{html.escape(heading)}</h2>", '<section class="card verdicts">']
        for verdict, things in verdicts.items():
            entries = "".join(f"<li>{html.escape(thing)}</li>" for thing in things)
            parts.append(f"<div><b>{html.escape(verdict)}</b><ul>{entries}</ul></div>")
        parts.append("</section>")
    parts += [f"<h2>{html.escape(tables[0].caption)}</h2>", _render(tables[0])]
    parts.append("<h2>Figures</h2>")
    for caption, image in figures.items():
        data = base64.b64encode(image.read_bytes()).decode()
        words = html.escape(caption, quote=True)
        parts.append(
            f"<figure><figcaption>{words}</figcaption>"
            f'<img alt="{words}" src="data:image/png;base64,{data}"></figure>'
        )
    for table in tables[1:]:
        caption = html.escape(table.caption)
        parts.append(f"<details><summary>{caption}</summary>{_render(table)}</details>")
    style = resources.files("bsg_models.rendering").joinpath("report.css").read_text("utf-8")
    head = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{style}</style></head><body><main>\n"
    )
    write_bytes(path, (head + "\n".join(parts) + "\n</main></body></html>\n").encode())


_HOW = (
    "<p>Orange is what the robot saw, green what the model expects besides: a blind node is an "
    "object that was not seen, the fainter the less sure. Click a room, or the building on top, to "
    "compare what was seen, what is expected and what is really there; pick a class to see where "
    "it is expected.</p>"
)


def _render(table: Table) -> str:
    head = "".join(f"<th>{html.escape(name)}</th>" for name in table.header)
    rows = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in table.rows
    )
    return (
        f'<section class="card scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{rows}</tbody></table></section>"
    )
