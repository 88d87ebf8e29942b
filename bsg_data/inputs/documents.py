"""Parse JSON, YAML and TOML that others wrote: plain data, a key once.

Any fault is one ValueError, with the line if the parser knows it.
"""

from __future__ import annotations

import codecs
import json
import re
import sys
from collections import Counter
from collections.abc import Hashable
from pathlib import Path
from typing import Any, NoReturn

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import Refusal, read_bytes
from bsg_data.inputs.bounds import MAX_VALUES
from bsg_data.words.shown import SHOWN, show_value

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # the same, from before it was in Python

_FORM = '. JSON has double quotes, and no comma before ] or }: {"kitchen": ["sink", "stove"]}'
_HALF = re.compile(r"\\u[dD][89a-fA-F]")  # half a character, if the other half is not beside it
_MARKS = {  # of the order of bytes → the encoding
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",  # begins as UTF-16 does
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}


def read_json(
    path: Path, bound: int | None = None, *, once: bool = True, error: Refusal = SourceError
) -> Any:
    """Read a JSON file, packed or not; one that may come by the network has a bound in bytes."""
    data = read_bytes(path, bound, error=error)
    return require_json(data, path, once=once, is_bounded=bound is not None, error=error)


def require_json(
    data: bytes,
    where: Path | str,
    *,
    once: bool = True,
    is_bounded: bool = False,
    error: Refusal = SourceError,
) -> Any:
    """Parse the JSON of a file, or of a place in one, which an error names; see `parse_json`."""
    try:
        text = decode(data)
        if is_bounded and (found := sum(map(text.count, "[{,"))) > MAX_VALUES:
            raise ValueError(f"expected at most {MAX_VALUES:,} values, found {found:,}")
        if not text.strip():
            raise ValueError("an empty file")
        return parse_json(text, once=once)
    except ValueError as fault:
        form = _FORM if is_bounded and isinstance(fault, json.JSONDecodeError) else ""
        message = f"{where}: expected JSON ({str(fault)[:200]}){form}"
        raise error(message, code="json-malformed", where=where) from fault


def parse_json(data: bytes | str, *, once: bool = True) -> Any:
    """Parse JSON; a key that is there twice is refused if `once`, else its last value is taken."""
    text = decode(data)
    try:
        hook = _require_once if once else None
        document = json.loads(text, object_pairs_hook=hook, parse_constant=_refuse_number)
        if _HALF.search(text):
            json.dumps(document, ensure_ascii=False).encode()  # noqa: TID251
    except RecursionError:
        raise ValueError("nested too deep") from None
    except UnicodeEncodeError:
        raise ValueError("half a character, as \\ud800") from None
    return document


def _refuse_number(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number of JSON")


def parse_yaml(data: bytes) -> Any:
    """Parse YAML as text, lists and mappings alone."""
    import yaml  # slow to import, and JSON does not need it

    class PlainLoader(yaml.BaseLoader):  # type: ignore[misc] # the faster one ends the process where nesting is deep
        """Constructs text, lists and mappings, whose keys are there once."""

        def construct_mapping(
            self, node: yaml.MappingNode, deep: bool = False
        ) -> dict[Hashable, Any]:
            keys = Counter(key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode))
            if len(keys) < len(node.value):
                (twice, times), *_ = keys.most_common(1) or [("", 0)]
                fault = (
                    f"the key {show_value(twice)} twice"
                    if times > 1
                    else "a list or a mapping as a key"
                )
                raise ValueError(fault)
            return dict(super().construct_mapping(node, deep=deep))

    try:
        return yaml.load(decode(data), Loader=PlainLoader)  # noqa: S506 -- text, lists, mappings
    except RecursionError:
        raise ValueError("expected YAML (nested too deep)") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ValueError(f"expected YAML ({' '.join(str(error).split())[:200]})") from error


def parse_toml(text: bytes | str) -> dict[str, Any]:
    """Parse TOML."""
    try:
        return tomllib.loads(decode(text))
    except RecursionError:
        raise ValueError("nested too deep") from None
    except tomllib.TOMLDecodeError as error:
        why = str(error)
        cut = why if len(why) < 3 * SHOWN else f"{why[:SHOWN]}...{why[-SHOWN:]}"
        raise ValueError(cut) from error


def decode(data: bytes | str) -> str:
    """Return text of UTF-8, or of another Unicode that its mark names; without the mark."""
    if isinstance(data, str):
        return data.removeprefix("\ufeff")
    encoding = next((name for mark, name in _MARKS.items() if data.startswith(mark)), "utf-8")
    if encoding == "utf-8" and b"\0" in data[:4]:
        raise ValueError(f"{_guess_encoding(data)}; save it as UTF-8")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-8":
            raise ValueError(f"not {encoding.upper()}, as it begins") from None
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start]
        raise ValueError(
            f"line {line}: byte 0x{byte:02X} is not UTF-8 but {_guess_encoding(data)}; save it as "
            "UTF-8"
        ) from None


def _guess_encoding(data: bytes) -> str:
    if data[:200].count(0) > len(data[:200]) // 4:
        return "UTF-16 without its mark"
    return "probably Windows-1252 or Latin-1"


def _require_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {show_value(twice)} twice; expected once")
    return table
