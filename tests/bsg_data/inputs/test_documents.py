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
from bsg_data.inputs import documents
from bsg_data.inputs.bounds import MAX_LABEL_COLUMNS, MAX_LINE
from bsg_data.inputs.documents import parse_csv, parse_json, parse_toml, parse_yaml, read_json

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


@pytest.mark.parametrize(
    "text",
    [
        "",
        '{"a": 1,\n "b": }',
        '[{"b": {"a": 1, "c": 0, "a": 1}}]',
        "NaN",
        "1" * 5000,
        b'{"a":\n"\xff"}',
        '"\\ud800"',
        "[" * 100_000,
    ],
)
def test_what_is_no_json_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_json(text)


def test_a_key_twice_may_be_allowed_and_brackets_in_words_nest_nothing() -> None:
    assert parse_json('{"a": 1, "a": 2}', once=False) == {"a": 2}
    assert parse_json(json.dumps(["[" * 500])) == ["[" * 500]


def test_a_file_of_json_is_read_with_the_error_of_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("[1")
    with refuses(DatasetError, "json-malformed", path):
        read_json(path, 9, error=DatasetError)


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
    "text",
    [
        b"a: &x 1\nb: *x",
        b"a: 1\nb: 2\na: 3",
        b"? [a]\n: 1",
        b"--- a\n--- b",
        b"[" * 100_000,
        b"- " * 101 + b"a",
        b"[a",
        b"\xff\xfe\xfd",
    ],
)
def test_what_is_no_plain_yaml_is_a_value_error(text: bytes) -> None:
    with pytest.raises(ValueError, match="no YAML"):
        parse_yaml(text)


def test_yaml_of_nothing_and_of_tags() -> None:
    assert parse_yaml(b"") is None
    assert parse_yaml(b"!!python/object/apply:os.system [ls]") == ["ls"]


@pytest.mark.parametrize(
    "text", ["a = ", "a = " + "[" * 100_000, "a" + ".a" * 100 + " = 1", b"a = '\xff'"]
)
def test_what_is_no_toml_is_a_value_error(text: str | bytes) -> None:
    assert parse_toml(b"[a]\nb = [1, 2]") == {"a": {"b": [1, 2]}}
    with pytest.raises(ValueError, match=r"."):
        parse_toml(text)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"a,b\n" * 6, "line 6: expected at most 5 rows"),
        (b"a\n" + b"," * MAX_LABEL_COLUMNS, "line 2: expected at most 1,000 columns, found 1,001"),
        (b"a\n" + b"x" * (MAX_LINE + 1), "line 2: expected at most 1,048,576 characters"),
        (b'a\n"b', "line 2: a quote is not closed"),
        (b"a\n\xff", "line 2: not UTF-8"),
    ],
)
def test_a_table_of_text_beyond_its_bounds_is_refused_at_its_line(data: bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        list(parse_csv(data, most_rows=5))


def test_a_table_of_text_has_the_last_line_of_each_row() -> None:
    rows = [(1, ["é", "b"]), (3, ["1\n2", "3"]), (4, []), (5, ["4"])]
    assert [*parse_csv('\ufeffé;b\n"1\n2";3\n\n4'.encode(), most_rows=9, separator=";")] == rows


def test_yaml_of_too_many_nodes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "MAX_NODES", 5)
    with pytest.raises(ValueError, match=r"^no YAML \(more than 5 texts"):
        parse_yaml(b"[a,a,a,a,a]")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a" + ".a" * 30_000 + " = 1", "line 1: expected at most 4,096 characters, found 60,005"),
        ("\n".join(f"a{n}" + ".a" * 2_000 + " = 1" for n in range(2)), "nested more than 100"),
        (f"a = {'9' * 4_000}\nb = {'9' * 4_000}", "a whole number beyond 64 bits"),
        (f"a = [0, [0x{'f' * 4_000}]]", "a whole number beyond 64 bits"),
        (
            f"x = {{{'q' * 2_000} = 1, {'q' * 2_000} = 1}}",
            r"q\.\.\.q+' \(at line 1, column 4016\)$",
        ),
    ],
)
def test_toml_that_takes_memory_or_a_page_is_a_short_error(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        parse_toml(text)
    assert len(str(caught.value)) < 250


def test_keys_that_may_be_there_twice_are_counted_once_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A graph of Hydra has few kinds of keys, however many nodes; six million took 1.2 GB."""
    monkeypatch.setattr("bsg_data.inputs.documents.MAX_KEYS", 5)
    same = ",".join(['{"a": 1}'] * 20)
    assert len(parse_json(f"[{same}]", once=False)) == 20
    with pytest.raises(ValueError, match="at most 5 different keys"):
        parse_json("[" + ",".join(f'{{"a{n}" : 1}}' for n in range(20)) + "]", once=False)


def test_keys_are_counted_whatever_stands_before_their_colon(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(documents, "MAX_KEYS", 4)
    four = '"a":1,"b" :1,"c"\n\t:1,"d"\r  :1'
    assert [*parse_json(f"{{{four}}}")] == ["a", "b", "c", "d"]
    with pytest.raises(ValueError, match="expected at most 4 keys, found more"):
        parse_json(f'{{{four},"e" :1}}')
