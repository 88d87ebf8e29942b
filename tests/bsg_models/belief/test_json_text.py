"""The text of a JSON document: parts are found where they are, and cut out as they were put in."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_models.belief.json_text import (
    Edit,
    append_parts,
    apply_edits,
    cut_parts,
    find_member,
    find_start,
    list_parts,
)

TEXT = ' {"a" : [1e-05,\n 0.10000000000000001],\t"b":{},"a":NaN } \n'

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=12,
)
lists = st.lists(values) | st.dictionaries(st.text(), values)
indents = st.sampled_from([None, 0, 1, 4, "\t"])


def test_parts_by_hand() -> None:
    start = find_start(TEXT)
    parts = list_parts(TEXT, start)
    assert [(part.key, TEXT[part.start : part.end]) for part in parts] == [
        ("a", "[1e-05,\n 0.10000000000000001]"),
        ("b", "{}"),
        ("a", "NaN"),
    ]
    assert TEXT[parts[1].begin :].startswith('"b"')
    found = find_member(parts, "a")
    assert found is parts[2], "readers take the last of equal keys"
    assert find_member(parts, "c") is None
    assert find_start("\ufeff\n [") == 3
    with pytest.raises(ValueError, match="an object or a list at character 3"):
        list_parts('{"a":1}', 3)


def append(text: str, start: int, *added: str) -> Edit:
    return append_parts(text, start, list_parts(text, start), added)


def test_what_is_put_in_is_spaced_like_its_neighbour() -> None:
    start = find_start(TEXT)
    put = apply_edits(TEXT, [append(TEXT, start, '"c":0')])
    assert put == TEXT.replace("NaN", 'NaN,"c":0')
    numbers, empty, _ = list_parts(TEXT, start)
    edits = [append(TEXT, empty.start, '"x":1'), append(TEXT, numbers.start, "2", "3")]
    put = apply_edits(TEXT, edits)
    assert put == ' {"a" : [1e-05,\n 0.10000000000000001,\n 2,\n 3],\t"b":{"x":1},"a":NaN } \n'


@given(document=lists, added=st.lists(values, min_size=1, max_size=3), indent=indents)
def test_what_was_put_in_is_cut_out_again(document: Any, added: list[Any], indent: Any) -> None:
    text = json.dumps(document, indent=indent)
    keyed = isinstance(document, dict)
    texts = [
        f"{json.dumps(f'new {number}')}: {json.dumps(value)}" if keyed else json.dumps(value)
        for number, value in enumerate(added)
    ]
    longer = apply_edits(text, [append(text, 0, *texts)])
    more = {f"new {number}": value for number, value in enumerate(added)} if keyed else added
    assert json.loads(longer) == (document | more if keyed else document + more)
    parts = list_parts(longer, 0)
    last = range(len(parts) - len(added), len(parts))
    assert apply_edits(longer, cut_parts(parts, last)) == text


@given(document=st.lists(values), indent=indents, data=st.data())
def test_any_items_are_cut(document: list[Any], indent: Any, data: st.DataObject) -> None:
    text = json.dumps(document, indent=indent)
    places = range(len(document))
    chosen = data.draw(st.sets(st.sampled_from(places)) if places else st.just(set()))
    left = apply_edits(text, cut_parts(list_parts(text, 0), chosen))
    assert json.loads(left) == [item for place, item in enumerate(document) if place not in chosen]
