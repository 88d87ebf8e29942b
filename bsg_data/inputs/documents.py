"""Parse untrusted JSON, YAML and TOML in linear time, with unique keys and limited nesting.

Any fault is one ValueError, with line and column if the parser knows them. Aliases, tags, infinite
numbers and text that cannot be written again are refused.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import Refusal, read_bytes
from bsg_data.inputs.bounds import MAX_CONTAINERS, MAX_NESTING, Bound
from bsg_data.spelling import SHOWN

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # the same, from before it was in Python

_LOADER = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader
_STEPS = np.zeros(256, dtype=np.int8)
_STEPS[list(b"[{")], _STEPS[list(b"]}")] = 1, -1
_NO_BRACKETS = bytes(set(range(256)) - set(b"[]{}"))
_MAX_POINTS = 2 * MAX_NESTING  # of a line of TOML: a key of many parts takes their square
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")


def read_json(path: Path, bound: Bound, *, error: Refusal = SourceError) -> Any:
    """Read a JSON file, packed or not.

    Raises:
        SourceError: or what `error` makes, if it cannot be read, is too large or is no JSON.
    """
    data = read_bytes(path, bound, error=error)
    try:
        return parse_json(data)
    except ValueError as fault:
        raise error(f"{path}: no JSON ({fault})") from fault


def parse_json(data: bytes | str, *, once: bool = True) -> Any:
    """Parse JSON.

    Args:
        data: the text, or its bytes.
        once: whether a key that is there twice is refused; otherwise its last value is taken.

    Raises:
        ValueError: if it is none, is not UTF-8, has a key twice, a number that is none of JSON's or
            has thousands of digits, half a character, or is nested beyond reason.
    """
    text = decode(data)
    if text.count("[") + text.count("{") > MAX_CONTAINERS:  # those in words, too
        raise ValueError(f"more than {MAX_CONTAINERS:,} lists and mappings")
    try:
        document = json.loads(
            text, object_pairs_hook=_once if once else None, parse_constant=_refuse_constant
        )
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno}, column {error.colno}: {error.msg}") from None
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except _ConstantError as error:
        raise ValueError(_locate_constant(text, str(error))) from None
    except ValueError as error:
        raise ValueError(_explain_digits(error)) from None
    if _measure_nesting(text) > MAX_NESTING:
        raise ValueError(_TOO_DEEP)
    if _SURROGATE.search(text):
        _require_characters(document)
    return document


def parse_yaml(data: bytes) -> Any:
    """Parse YAML as text, lists and mappings alone.

    Raises:
        ValueError: if it is none, has an alias or a key twice, or is nested beyond reason.
    """
    if re.search(rb"^%", data, re.MULTILINE):  # libyaml compares each directive with all others
        raise ValueError("no plain YAML (a line begins with %, as a directive does)")
    try:
        return _compose(yaml.parse(data, Loader=_LOADER))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ValueError(f"no YAML ({' '.join(str(error).split())[:200]})") from error


def parse_toml(text: bytes | str) -> dict[str, Any]:
    """Parse TOML.

    Raises:
        ValueError: if it is none, is not UTF-8, has a number of thousands of digits, or is nested
            beyond reason.
    """
    plain = decode(text)
    if any(line.count(".") > _MAX_POINTS for line in plain.split("\n")):
        raise ValueError(_TOO_DEEP)
    try:
        tables = tomllib.loads(plain)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError as error:
        raise ValueError(_explain_digits(error)) from None
    _require_nesting(tables)
    return tables


def decode(data: bytes | str) -> str:
    """Return UTF-8 text, without a byte order mark.

    Raises:
        ValueError: naming the first line that is none.
    """
    if isinstance(data, str):
        return data.removeprefix("\ufeff")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        raise ValueError(f"line {line}, column {column}: not UTF-8") from None


_TOO_DEEP = f"lists and mappings nested more than {MAX_NESTING} deep"


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        raise ValueError(f"the key {_find_twice(key for key, _ in pairs)[:SHOWN]!r} twice")
    return table


def _find_twice(keys: Iterable[str]) -> str:
    seen: set[str] = set()
    return next(key for key in keys if key in seen or seen.add(key))  # type: ignore[func-returns-value]


class _ConstantError(ValueError):
    """Report NaN or an infinity, by its name."""


def _refuse_constant(name: str) -> float:
    raise _ConstantError(name)


def _locate_constant(text: str, name: str) -> str:
    """Return where a word first stands outside the strings of JSON, and that it is no number."""
    at = 0
    for number, part in enumerate(text.replace("\\\\", "__").replace('\\"', "__").split('"')):
        if number % 2 == 0 and name in part:
            at += part.index(name)
            break
        at += len(part) + 1
    line, column = text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)
    return f"line {line}, column {column}: {name}, which is no number of JSON"


def _explain_digits(error: ValueError) -> str:
    """Return what an error says; of a number too long for Python, without its advice."""
    said = str(error)
    return "a number of thousands of digits" if said.startswith("Exceeds the limit") else said


def _measure_nesting(text: str) -> int:
    """Return how deep a text that is JSON is nested."""
    plain = text.encode("utf-8", "surrogatepass").replace(b"\\\\", b"").replace(b'\\"', b"")
    outside = b"".join(plain.split(b'"')[::2])
    brackets = np.frombuffer(outside.translate(None, _NO_BRACKETS), dtype=np.uint8)
    return int(np.cumsum(_STEPS[brackets], dtype=np.int32).max(initial=0))


def _require_characters(document: Any) -> None:
    """Refuse a half of a character, which no file can hold."""
    try:
        json.dumps(document, ensure_ascii=False).encode()  # noqa: TID251 -- text, never a file
    except UnicodeEncodeError as error:
        half = error.object[error.start]
        raise ValueError(f"half a character, \\u{ord(half):04x}, without its other half") from None


def _require_nesting(document: Any) -> None:
    level = [document]
    for _ in range(MAX_NESTING + 1):
        level = [inner for value in level for inner in _list_inner(value)]
        if not level:
            return
    raise ValueError(_TOO_DEEP)


def _list_inner(value: Any) -> Iterable[Any]:
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, list) else ()


def _compose(events: Iterator[Any]) -> Any:
    """Return what the events of one YAML document say, in one pass."""
    documents: list[Any] = []
    open_nodes: list[_Node] = [_Node(documents)]
    for event in events:
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"an alias, {event.anchor!r}")
        if isinstance(event, yaml.ScalarEvent):
            open_nodes[-1].add(event.value)
        elif isinstance(event, yaml.CollectionStartEvent):
            is_list = isinstance(event, yaml.SequenceStartEvent)
            open_nodes.append(_Node([] if is_list else {}))
            if len(open_nodes) > MAX_NESTING + 1:
                raise ValueError(_TOO_DEEP)
        elif isinstance(event, yaml.CollectionEndEvent):
            whole = open_nodes.pop().content
            open_nodes[-1].add(whole)
        if len(documents) > 1:
            raise ValueError("several documents, expected one")
    return documents[0] if documents else None


class _Node:
    """A list or a mapping that is being read."""

    def __init__(self, content: list[Any] | dict[str, Any]) -> None:
        self.content = content
        self._key: str | None = None

    def add(self, value: Any) -> None:
        """Take an entry of a list, or in turn a key of a mapping and its value."""
        if isinstance(self.content, list):
            self.content.append(value)
        elif self._key is not None:
            self.content[self._key] = value
            self._key = None
        elif not isinstance(value, str):
            raise ValueError("a list or a mapping as a key")
        elif value in self.content:
            raise ValueError(f"the key {value[:SHOWN]!r} twice")
        else:
            self._key = value
