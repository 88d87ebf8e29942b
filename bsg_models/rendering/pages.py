"""Pages from templates: all text is escaped, and data in a script cannot end the script.

The templates lie beside this file, `*.html.jinja`, and so do the style sheets and scripts that they
include; `theme.css` and `theme.js` are of every page.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from bsg_data.files import encode_json


def render_page(template: str, **values: Any) -> str:
    """Return a page; what is missing from the values is an error.

    Args:
        template: name of a file beside this one, e.g. `report.html.jinja`.
        values: which the template names.
    """
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
    environment.globals["include_file"] = _read_own
    return environment


def encode_for_script(value: Any) -> Markup:
    """Return JSON that cannot end the script element that it stands in."""
    text = encode_json(value, ensure_ascii=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)  # noqa: S704 - the signs that could be markup are gone


def _read_own(name: str) -> Markup:
    """Return a style sheet or a script of ours, which needs no escaping."""
    text = resources.files("bsg_models.rendering").joinpath(name).read_text("utf-8")
    return Markup(text)  # noqa: S704 - it lies beside this file
