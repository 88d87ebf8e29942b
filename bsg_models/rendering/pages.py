"""Fill HTML templates: all text is escaped, and only the scripts beside this file run.

A template, `*.html.jinja`, extends `page.html.jinja`. Each style sheet and script of this folder
stands whole in its own element. The page's Content-Security-Policy lists the hash of each, so a
browser runs nothing else, loads nothing, and makes no markup from text. Every page has `theme.css`
and `theme.js`.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from bsg_data.files import encode_json, write_bytes
from bsg_data.tables import Rows

_ELEMENTS = {".css": "style", ".js": "script"}


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a page; a caption may have several lines."""

    caption: str
    header: Sequence[str]
    rows: Rows
    folded: bool = False  # at the end, and opened by a click


def write_report(
    path: Path,
    *,
    title: str,
    facts: Sequence[str],
    tables: Sequence[Table],
    figures: Mapping[str, Path],
    findings: Mapping[str, Mapping[str, Sequence[str]]] = MappingProxyType({}),
    explorer: str | None = None,
) -> None:
    """Write results as one self-contained page. A failed write leaves no partial file.

    `facts` are paragraphs: what was measured, on which buildings. `figures` are caption → PNG file.
    `findings` are heading → verdict → the metrics with it, and `explorer` is a page of
    `explorer_page`, shown in a frame.
    """
    pictures = {
        caption: base64.b64encode(image.read_bytes()).decode() for caption, image in figures.items()
    }
    page = render_page(
        "report.html.jinja",
        title=title,
        facts=facts,
        findings=findings,
        tables=tables,
        figures=pictures,
        explorer=explorer,
    )
    write_bytes(path, page.encode())


def render_page(template: str, **values: Any) -> str:
    """Fill a template beside this file; a missing value is an error."""
    return _environment().get_template(template).render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("bsg_models.rendering", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["script_json"] = encode_for_script
    environment.globals["own_element"] = _own_element
    environment.globals["policy"] = _content_security_policy
    return environment


def encode_for_script(value: Any) -> str:
    """Return JSON that cannot close the script element around it; templates do not escape it."""
    text = encode_json(value, ensure_ascii=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


@cache
def _content_security_policy() -> str:
    """Return the policy of every page: run our scripts, use our style sheets, show its pictures.

    All pages share one policy, because a report contains the explorer. The hashes are those of the
    files beside this one and do not depend on what a page holds. Scripts set the styles that depend
    on numbers; the policy forbids `style` attributes. It also forbids every policy of Trusted
    Types, so no script can make markup from text.
    """
    hashes: dict[str, list[str]] = {element: [] for element in _ELEMENTS.values()}
    beside = resources.files("bsg_models.rendering").iterdir()
    for name in sorted(file.name for file in beside):
        element = _ELEMENTS.get(name[name.rfind(".") :])
        if element:
            digest = hashlib.sha256(_read_own(name).encode()).digest()
            hashes[element].append(f"'sha256-{base64.b64encode(digest).decode()}'")
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {' '.join(hashes['script'])}",
            f"style-src {' '.join(hashes['style'])}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
            "require-trusted-types-for 'script'",
            "trusted-types 'none'",
        )
    )


def _own_element(name: str) -> str:
    """Return a style sheet or script of this folder in its element; templates do not escape it."""
    element = _ELEMENTS[name[name.rfind(".") :]]
    return f"<{element}>{_read_own(name)}</{element}>"


def _read_own(name: str) -> str:
    return "\n" + resources.files("bsg_models.rendering").joinpath(name).read_text("utf-8")
