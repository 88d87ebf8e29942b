"""Parse JSON, YAML and TOML that others wrote: plain data, nested within bounds, a key once.

Any fault is one ValueError, with the line if the parser knows it.
"""

from __future__ import annotations

import csv
import io
import json
import re
import sys
from collections import Counter
from collections.abc import Hashable
from itertools import islice
from pathlib import Path
from typing import Any

import yaml
from pydantic_core import from_json

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import Refusal, read_bytes
from bsg_data.inputs.bounds import (
    MAX_CONTAINERS,
    MAX_KEYS,
    MAX_LABEL_COLUMNS,
    MAX_LINE,
    MAX_NESTING,
    MAX_NODES,
    MAX_TOML_LINE,
    MAX_VALUES,
)
from bsg_data.words.shown import SHOWN, show_value

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # the same, from before it was in Python

_KEY = re.compile(rb'"[ \t\n\r]*:')  # the end of a key of JSON
_PARSER = yaml.CBaseLoader if yaml.__with_libyaml__ else yaml.BaseLoader


def read_json(path: Path, bound: int, *, error: Refusal = SourceError) -> Any:
    """Read a JSON file, packed or not."""
    data = read_bytes(path, bound, error=error)
    if not data.strip():
        raise error(
            f"{path}: expected JSON, found an empty file", code="json-malformed", where=path
        )
    return require_json(data, path, error=error)


def require_json(
    data: bytes, where: Path | str, *, once: bool = True, error: Refusal = SourceError
) -> Any:
    """Parse the JSON of a file, or of a place in one, which an error names; see `parse_json`."""
    try:
        return parse_json(data, once=once)
    except ValueError as fault:
        raise error(f"{where}: no JSON ({fault})", code="json-malformed", where=where) from fault


def parse_json(data: bytes | str, *, once: bool = True) -> Any:
    """Parse JSON; a key that is there twice is refused if `once`, else its last value is taken."""
    text = data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data
    _require_bounded(text, keys=MAX_KEYS if once else MAX_VALUES)
    fault = _find_key_twice(text) if once else None  # before there is a second document in memory
    try:
        document = from_json(text.removeprefix(b"\xef\xbb\xbf"), allow_inf_nan=False)
    except ValueError as error:
        if "recursion limit" in str(error):
            raise ValueError("nested more than 200 deep") from None
        raise
    if fault is not None:
        raise fault
    return document


def _find_key_twice(text: bytes) -> ValueError | None:
    """Return the fault of a key that is there twice; also one that only Python's parser finds."""
    try:
        json.loads(text.decode("utf-8-sig"), object_pairs_hook=_require_once)
    except (ValueError, RecursionError) as error:  # the other parser says it with its place
        return error if isinstance(error, ValueError) else ValueError("nested too deep")
    return None


def _require_bounded(text: bytes, *, keys: int) -> None:
    """Refuse JSON that would take gigabytes as objects, however few bytes it has."""
    containers = text.count(b"[") + text.count(b"{")
    values = containers + text.count(b",")
    for found, bound, what in (
        (containers, MAX_CONTAINERS, "lists and objects"),
        (values, MAX_VALUES, "values"),
    ):
        if found > bound:
            raise ValueError(f"expected at most {bound:,} {what}, found {found:,}")
    if next(islice(_KEY.finditer(text), keys, None), None) is not None:
        raise ValueError(f"expected at most {keys:,} keys, found more")
    if keys > MAX_KEYS and next(islice(_KEY.finditer(text), MAX_KEYS, None), None) is not None:
        _require_few_kinds(text)


def _require_few_kinds(text: bytes) -> None:
    """Refuse keys that all differ; of those that do not, a document holds one."""
    kinds: set[bytes] = set()
    for one in _KEY.finditer(text):
        kinds.add(text[text.rfind(b'"', 0, one.start()) + 1 : one.start()])
        if len(kinds) > MAX_KEYS:
            raise ValueError(f"expected at most {MAX_KEYS:,} different keys, found more")


def parse_yaml(data: bytes) -> Any:
    """Parse YAML as text, lists and mappings alone."""
    depth = nodes = 0
    try:
        for event in yaml.parse(data, Loader=_PARSER):  # aliases multiply what is read
            if isinstance(event, yaml.AliasEvent):
                raise ValueError(f"an alias, {show_value(event.anchor)}")
            nodes += isinstance(event, yaml.NodeEvent)
            if nodes > MAX_NODES:
                raise ValueError(f"more than {MAX_NODES:,} texts, lists and mappings")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_NESTING:
                raise ValueError(f"nested more than {MAX_NESTING} deep")
        return yaml.load(data, Loader=_PlainLoader)  # noqa: S506 -- text, lists, mappings
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(f"no YAML ({' '.join(str(error).split())[:200]})") from error


def parse_toml(text: bytes | str) -> dict[str, Any]:
    """Parse TOML, whose lines are short and whose whole numbers have 64 bits."""
    said = decode(text)
    for number, line in enumerate(said.split("\n"), start=1):
        if len(line) > MAX_TOML_LINE:
            raise ValueError(
                f"line {number}: expected at most {MAX_TOML_LINE:,} characters, "
                f"found {len(line):,}; write a list on several lines"
            )
    too_deep, too_wide = f"nested more than {MAX_NESTING} deep", "a whole number beyond 64 bits"
    try:
        parsed = tomllib.loads(said)
    except RecursionError:
        raise ValueError(too_deep) from None
    except tomllib.TOMLDecodeError as error:
        why = str(error)
        cut = why if len(why) < 3 * SHOWN else f"{why[:SHOWN]}...{why[-SHOWN:]}"
        raise ValueError(cut) from error
    except ValueError:  # of digits that Python refuses to read
        raise ValueError(too_wide) from None
    level: list[Any] = [parsed]
    for _ in range(MAX_NESTING):
        inner = [two for one in level for two in (one.values() if isinstance(one, dict) else one)]
        if any(isinstance(one, int) and not -(2**63) <= one < 2**63 for one in inner):
            raise ValueError(too_wide)
        level = [one for one in inner if isinstance(one, dict | list)]
    if level:
        raise ValueError(too_deep)
    return parsed


def parse_csv(data: bytes, *, most_rows: int, separator: str = ",") -> list[tuple[int, list[str]]]:
    """Return the rows of a table of text, each with the number of its last line."""
    reader = csv.reader(_split_lines(decode(data)), strict=True, delimiter=separator)
    rows: list[tuple[int, list[str]]] = []
    try:
        for row in reader:
            if len(rows) == most_rows:
                raise ValueError(f"line {reader.line_num}: expected at most {most_rows:,} rows")
            if len(row) > MAX_LABEL_COLUMNS:
                raise ValueError(
                    f"line {reader.line_num}: expected at most {MAX_LABEL_COLUMNS:,} columns, "
                    f"found {len(row):,}"
                )
            rows.append((reader.line_num, row))
    except csv.Error as error:
        why = "a quote is not closed" if "end of data" in str(error) else error
        raise ValueError(f"line {reader.line_num}: {why}") from error
    return rows


def _split_lines(text: str) -> list[str]:
    lines = io.StringIO(text, newline="").readlines()
    sizes = [*map(len, lines)]
    if max(sizes, default=0) > MAX_LINE:
        number = next(number for number, size in enumerate(sizes, start=1) if size > MAX_LINE)
        raise ValueError(f"line {number}: expected at most {MAX_LINE:,} characters")
    return lines


def decode(data: bytes | str) -> str:
    """Return UTF-8 text, without a byte order mark."""
    if isinstance(data, str):
        return data.removeprefix("\ufeff")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(f"line {line}: not UTF-8") from None


def _require_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {show_value(twice)} twice")
    return table


class _PlainLoader(_PARSER):  # type: ignore[misc,valid-type]
    """Constructs text, lists and mappings, whose keys are there once."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        keys = Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        if len(keys) < len(node.value):
            (twice, times), *_ = keys.most_common(1) or [("", 0)]
            said = (
                f"the key {show_value(twice)} twice"
                if times > 1
                else "a list or a mapping as a key"
            )
            raise ValueError(said)
        return dict(super().construct_mapping(node, deep=deep))
