"""Documents of strangers: what they say, and one error for whatever is wrong with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.errors import DatasetError
from bsg_data.inputs import documents
from bsg_data.inputs.bounds import MAX_NESTING, Bound
from bsg_data.inputs.documents import parse_json, parse_toml, parse_yaml, read_json

words = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | words
trees = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3)
)


@given(trees, st.booleans())
def test_json_is_what_the_library_reads(tree: Any, ascii_only: bool) -> None:
    text = json.dumps(tree, ensure_ascii=ascii_only).replace("Infinity", "1e400")
    assert parse_json(text) == parse_json(text.encode()) == json.loads(text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1, column 1: Expecting value"),
        ('{"a": 1,\n "b": }', "line 2, column 7: Expecting value"),
        ('{"a": 1, "a": 2}', "the key 'a' twice"),
        ('[{"b": {"a": 1, "c": 0, "a": 1}}]', "the key 'a' twice"),
        ("NaN", "line 1, column 1: NaN, which is no number of JSON"),
        ('["NaN\\\\\\"",\n -Infinity]', "line 2, column 2: -Infinity, which is no number of JSON"),
        ("1" * 5000, "a number of thousands of digits"),
        (b'{"a":\n"\xff"}', "line 2, column 2: not UTF-8"),
        ('"\\ud800"', "half a character"),
        ('{"\\uDFFF": 1}', "half a character"),
        ("[" * 100_000, "nested more than 100 deep"),
        ("[" * 101 + "]" * 101, "nested more than 100 deep"),
        ('{"a":' * 101 + "1" + "}" * 101, "nested more than 100 deep"),
    ],
)
def test_what_is_no_json_is_one_error(text: str | bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        parse_json(text)
    assert type(caught.value) is ValueError


def test_brackets_in_words_nest_nothing_and_the_last_level_is_allowed() -> None:
    assert parse_json(json.dumps(["[" * 500, '"[', "\\", '\\"[[', "x"]))[0] == "[" * 500
    deepest = "[" * MAX_NESTING + "]" * MAX_NESTING
    assert json.dumps(parse_json(deepest)) == deepest
    assert parse_json('{"a": 1, "a": 2}', once=False) == {"a": 2}
    assert parse_json('"\\ud83d\\ude00"') == "\N{GRINNING FACE}"


def test_a_file_of_json_is_read_with_the_error_of_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("[1")
    with pytest.raises(DatasetError, match=r"a\.json: no JSON \(line 1, column 3: Expecting"):
        read_json(path, Bound("", 9), error=DatasetError)
    with pytest.raises(DatasetError, match="expected at most 1"):
        read_json(path, Bound("", 1), error=DatasetError)


plain_words = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1, max_size=8)
plain = st.recursive(
    plain_words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(plain_words, inner, max_size=3),
)


@given(plain, st.booleans())
def test_yaml_is_what_the_library_reads_as_text(tree: Any, flow: bool) -> None:
    text = yaml.safe_dump(tree, default_flow_style=flow)
    assert parse_yaml(text.encode()) == yaml.load(text, yaml.BaseLoader)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &x 1\nb: *x", "an alias, 'x'"),
        ("a: 1\nb: 2\na: 3", "the key 'a' twice"),
        ("? [a]\n: 1", "a list or a mapping as a key"),
        ("--- a\n--- b", "several documents"),
        ("[" * 100_000, "nested more than 100 deep"),
        ("- " * 101 + "a", "nested more than 100 deep"),
        ("[a", "no YAML"),
        (b"\xff\xfe\xfd", "no YAML"),
        ("a: \0", "no YAML"),
    ],
)
def test_what_is_no_plain_yaml_is_one_error(text: str | bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse_yaml(text if isinstance(text, bytes) else text.encode())


def test_directives_are_refused_before_they_are_compared() -> None:
    """libyaml compares each with all before it: half a megabyte took half a minute."""
    lines = "".join(f"%TAG !a{number}! b\n" for number in range(40_000))
    with pytest.raises(ValueError, match="a line begins with %"):
        parse_yaml(f"{lines}--- x\n".encode())
    assert parse_yaml(b"a: 5%\nb: 'x %'\n") == {"a": "5%", "b": "x %"}


def test_lists_without_end_are_refused_before_they_are_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(documents, "MAX_CONTAINERS", 3)
    assert parse_json("[[], {}]") == [[], {}]
    with pytest.raises(ValueError, match="more than 3 lists and mappings"):
        parse_json("[[], {}, []]")


def test_yaml_of_nothing_and_of_tags() -> None:
    assert parse_yaml(b"") is None
    assert parse_yaml(b"!!python/object/apply:os.system [ls]") == ["ls"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a = ", "Invalid value"),
        ("a = " + "[" * 100_000, "nested more than 100 deep"),
        ("a = " + "[" * 101 + "]" * 101, "nested more than 100 deep"),
        (".".join("a" * 30_000) + " = 1", "nested more than 100 deep"),
        ("a = " + "1" * 5000, "a number of thousands of digits"),
        (b"a = '\xff'", "line 1, column 6: not UTF-8"),
    ],
)
def test_what_is_no_toml_is_one_error(text: str | bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse_toml(text)


def test_toml_says_what_it_says() -> None:
    assert parse_toml(b"[a]\nb = [1, 2]") == {"a": {"b": [1, 2]}}
