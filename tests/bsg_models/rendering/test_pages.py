"""Text from the data never becomes markup; a report says all that it was given, in order."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from random_beliefs import HOSTILE, make_belief

from bsg_models.rendering.explorer import ShownBelief, explorer_page
from bsg_models.rendering.pages import Table, encode_for_script, write_report


@given(st.text() | st.sampled_from([HOSTILE, "a\u2028b", "<!--", "]]>", "&lt;"]))
def test_json_cannot_leave_its_script_element(text: str) -> None:
    encoded = encode_for_script({"name": text})
    assert not set("<>&\u2028\u2029") & set(encoded)
    assert json.loads(encoded) == {"name": text}


def test_the_policy_has_the_hash_of_every_script_and_style_sheet_of_a_page() -> None:
    page = explorer_page([ShownBelief(make_belief(1))])
    (policy,) = re.findall(r'Content-Security-Policy" content="(.*?)"', page)
    policy = html.unescape(policy)
    inline = re.findall(r"<(script|style)>(.*?)</\1>", page, re.DOTALL)
    assert [kind for kind, _ in inline] == ["style"] * 2 + ["script"] * 9
    for kind, text in inline:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        (directive,) = re.findall(rf"{kind}-src ([^;]*)", policy)
        assert f"'sha256-{digest}'" in directive.split()
    assert not re.search(r"<[^>]* (on\w+|style)=", page), "an attribute that the policy refuses"
    assert page.index("Content-Security-Policy") < page.index("<title>") < page.index("<style>")
    assert "unsafe" not in policy
    # Scripts of a page cannot make markup from text.
    assert "require-trusted-types-for 'script'; trusted-types 'none'" in policy


PNG = b"\x89PNG\r\n\x1a\n-- no real one"
EXPLORER = '<!doctype html>\n<p title="a">&amp; more</p>'


class Reader(HTMLParser):
    """Collects elements with their attributes, and the text of each."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag  # every element is closed, in order

    def handle_data(self, data: str) -> None:
        if data.strip():
            self.texts.append((self.open[-1], data.strip()))


def test_everything_is_there_as_text_and_in_order(tmp_path: Path) -> None:
    (tmp_path / "figure.png").write_bytes(PNG)
    write_report(
        tmp_path / "report.html",
        title=f"Of {HOSTILE}",
        facts=["4 buildings & more", HOSTILE],
        findings={"beside doubling": {"better": ["presence", HOSTILE], "worse": []}},
        tables=[
            Table("In short", ["metric", HOSTILE], [["nll ↓", "0.1 ±0.02"], [HOSTILE, "-"]]),
            Table("Every metric", ["metric"], [["brier"]], folded=True),
        ],
        figures={f'"{HOSTILE}': tmp_path / "figure.png"},
        explorer=EXPLORER,
    )
    reader = Reader()
    reader.feed((tmp_path / "report.html").read_text("utf-8"))
    assert reader.open == []
    shown = {
        tag: [text for name, text in reader.texts if name == tag]
        for tag in ("title", "h1", "h2", "b", "li", "th", "td", "summary")
    }
    assert shown == {
        "title": [f"Of {HOSTILE}"],
        "h1": [f"Of {HOSTILE}"],
        "h2": ["In short", "beside doubling", "Look into a building", "Figures"],
        "b": ["better", "worse"],
        "li": ["presence", HOSTILE],
        "th": ["metric", HOSTILE, "metric"],
        "td": ["nll ↓", "0.1 ±0.02", HOSTILE, "-", "brier"],
        "summary": ["Every metric"],
    }
    assert [text for name, text in reader.texts if name == "p"][:2] == [
        "4 buildings & more",
        HOSTILE,
    ]
    tags = [tag for tag, _ in reader.elements]
    assert (tags.count("script"), tags.count("img")) == (1, 1), "the theme's, and the figure"
    attributes = dict(reader.elements)
    assert attributes["iframe"]["srcdoc"] == EXPLORER
    assert attributes["img"]["alt"] == f'"{HOSTILE}'
    source = str(attributes["img"]["src"])
    assert base64.b64decode(source.removeprefix("data:image/png;base64,")) == PNG
