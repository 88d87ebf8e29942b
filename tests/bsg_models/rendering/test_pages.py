"""Text from the data never becomes markup, and what a template lacks is an error."""

from __future__ import annotations

import base64
import hashlib
import json
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import TemplateNotFound, UndefinedError
from random_beliefs import HOSTILE, make_belief

from bsg_data.errors import DatasetError
from bsg_models.rendering.explorer import View, explorer_page
from bsg_models.rendering.pages import content_security_policy, encode_for_script, render_page

SCRIPT = re.compile(r'<script type="application/json" id="beliefs">(.*?)</script>', re.DOTALL)


@given(st.text() | st.sampled_from([HOSTILE, "a\u2028b", "<!--", "]]>", "&lt;"]))
def test_json_cannot_leave_its_script_element(text: str) -> None:
    encoded = encode_for_script({"name": text})
    assert not set("<>&\u2028\u2029") & set(encoded)
    assert json.loads(encoded) == {"name": text}


def test_numbers_that_json_has_not_are_refused() -> None:
    with pytest.raises(DatasetError, match="not finite"):
        encode_for_script(float("nan"))


def test_the_script_of_a_page_holds_the_names_as_they_are() -> None:
    page = explorer_page([View(make_belief(1), title=HOSTILE)])
    (data,) = SCRIPT.findall(page)
    assert json.loads(data)["views"][0]["title"] == HOSTILE
    assert HOSTILE not in page


def test_a_template_that_lacks_a_value_or_is_none_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="title"):
        render_page("report.html.jinja")
    with pytest.raises(TemplateNotFound):
        render_page("none.html.jinja")


def test_the_policy_has_the_hash_of_every_script_and_style_sheet_of_a_page() -> None:
    page = explorer_page([View(make_belief(1))])
    inline = re.findall(r"<(script|style)>(.*?)</\1>", page, re.DOTALL)
    assert [kind for kind, _ in inline] == ["style"] * 2 + ["script"] * 9
    for kind, text in inline:
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        (directive,) = re.findall(rf"{kind}-src ([^;]*)", content_security_policy())
        assert f"'sha256-{digest}'" in directive.split()
    assert not re.search(r"<[^>]* (on\w+|style)=", page), "an attribute that the policy refuses"
