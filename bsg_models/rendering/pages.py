"""Pages from templates: all text is escaped, and no script runs but those beside this file.

A template, `*.html.jinja`, fills `page.html.jinja`. Each style sheet and script of a page is a file
of ours, whole, in an element of its own, and the page's Content-Security-Policy has the hash of
each such file: a browser runs nothing else, loads nothing, and makes no markup from text.
`theme.css` and `theme.js` are of every page.
"""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from bsg_data.files import encode_json

_ELEMENTS = {".css": "style", ".js": "script"}


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
    environment.globals["own_element"] = _own_element
    environment.globals["policy"] = content_security_policy
    return environment


def encode_for_script(value: Any) -> Markup:
    """Return JSON that cannot end the script element that it stands in."""
    text = encode_json(value, ensure_ascii=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)  # noqa: S704 - the signs that could be markup are gone


@cache
def content_security_policy() -> str:
    """Return what a page may do: run our scripts, use our style sheets, show pictures in it.

    All pages have the same policy, since that of a report is also that of the explorer in it. The
    hashes are those of the files beside this one, never of what a page came to hold. Styles that
    depend on numbers are set by a script, which needs no permission; a `style` attribute has none.
    No policy of Trusted Types is allowed, so that no script of ours makes markup from text.
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


def _own_element(name: str) -> Markup:
    """Return a style sheet or a script of ours in its element: it needs no escaping."""
    element = _ELEMENTS[name[name.rfind(".") :]]
    return Markup(f"<{element}>{_read_own(name)}</{element}>")  # noqa: S704 - it lies beside this file


def _read_own(name: str) -> str:
    return "\n" + resources.files("bsg_models.rendering").joinpath(name).read_text("utf-8")
