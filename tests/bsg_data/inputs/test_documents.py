"""Documents of others: what they say, and one error for whatever is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import DatasetError
from bsg_data.inputs.documents import parse_json, parse_toml, parse_yaml, read_json

words = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | words
trees = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3)
)


@given(trees, st.booleans())
def test_json_is_what_the_library_reads(tree: Any, ascii_only: bool) -> None:
    text = json.dumps(tree, ensure_ascii=ascii_only).replace("Infinity", "1e400")
    read = parse_json(text)
    assert repr(read) == repr(parse_json(b"\xef\xbb\xbf" + text.encode())) == repr(json.loads(text))


DEEP = "[" * 100_000


@pytest.mark.parametrize(
    ("parse", "texts"),
    [
        (
            parse_json,
            (
                *("", '{"a": 1,\n "b": }', '[{"b": {"a": 1, "c": 0, "a": 1}}]', "NaN", "1" * 5000),
                *(b'{"a":\n"\xff"}', '"\\ud800"', DEEP),
            ),
        ),
        (
            parse_yaml,
            (
                *(b"a: 1\nb: 2\na: 3", b"? [a]\n: 1", b"--- a\n--- b", DEEP.encode(), b"[a"),
                b"\xff\xfe\xfd",
            ),
        ),
        (parse_toml, ("a = ", "a = " + DEEP, b"a = '\xff'")),
    ],
)
def test_whatever_is_wrong_is_a_value_error(parse: Any, texts: Any) -> None:
    for text in texts:
        with pytest.raises(ValueError, match=r"."):
            parse(text)


def test_a_key_twice_may_be_allowed_and_brackets_in_words_nest_nothing() -> None:
    assert parse_json('{"a": 1, "a": 2}', once=False) == {"a": 2}
    assert parse_json(json.dumps(["[" * 500])) == ["[" * 500]


@pytest.mark.parametrize(
    "data", [b"", b"{'a': 1}", b'{"a": [1,]}', b"a:\n  - b", '{"ü": 1}'.encode("cp1252")]
)
def test_a_file_that_is_no_json_is_refused_with_the_form_of_json(
    tmp_path: Path, data: bytes
) -> None:
    path = tmp_path / "a.json"
    path.write_bytes(data)
    with refuses(DatasetError, "json-malformed", path):
        read_json(path, 99, error=DatasetError)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-32"])
def test_json_with_the_mark_of_its_encoding_is_read(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "a.json").write_bytes('{"Küche": []}'.encode(encoding))
    assert read_json(tmp_path / "a.json") == {"Küche": []}


def test_json_of_the_network_has_a_bound_of_values(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bsg_data.inputs.documents.MAX_VALUES", 3)
    (tmp_path / "a.json").write_text("[1, 2, 3, 4]")
    assert read_json(tmp_path / "a.json") == [1, 2, 3, 4]
    with refuses(DatasetError, "json-malformed", tmp_path / "a.json"):
        read_json(tmp_path / "a.json", 99, error=DatasetError)


plain_words = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1, max_size=8)
plain = st.recursive(
    plain_words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(plain_words, inner, max_size=3),
)


@given(plain, st.booleans())
def test_yaml_is_what_the_library_reads_as_text(tree: Any, flow: bool) -> None:
    text = yaml.safe_dump(tree, default_flow_style=flow)
    assert parse_yaml(text.encode()) == yaml.load(text, yaml.BaseLoader)


def test_yaml_of_nothing_and_of_tags_and_toml() -> None:
    assert parse_yaml(b"") is None
    assert parse_yaml(b"!!python/object/apply:os.system [ls]") == ["ls"]
    assert parse_toml(b"[a]\nb = [1, 2]") == {"a": {"b": [1, 2]}}
