"""Changes of inputs: of bytes anywhere, and of one value of a JSON document for a hostile one."""

from __future__ import annotations

import json
import random
import re
from typing import Any

_HOSTILE: tuple[str, ...] = (  # as JSON's text, since Python could not write some
    *("5", "null", "true", "1.5", "-1", "0", "1e400", "-0.0", "NaN", "-Infinity", "1e-320"),
    *('""', '"\\ud800"', '"../../victim"', '"\\u0000"', '"x"', "[]", "{}", "[[]]", "[null]"),
    *("4294967296", "18446744073709551616", "-9223372036854775809", "9" * 5000, "1e308"),
    *('{"x":1}', "[1,2,3]", "[1,1]", "false", '"' + "y" * 600 + '"', "[" * 30 + "]" * 30),
    *("[" * 2000 + "]" * 2000, '{"a":' * 2000 + "1" + "}" * 2000, '{"a":1,"a":2}', '"nan"'),
    *('"\\u202e"', '"\\u001b[2J"', "[true]", '[""]', '[{"":0}]', "[[0,0]]", "1000000000000"),
)
_NUMBERS = (b"0", b"-1", b"4294967295", b"9" * 40, b"1e999", b"nan", b"-0", b"0.5")
_WORDS = tuple(
    word.encode()
    for word in (
        *(
            '"',
            ",-1",
            "\n",
            "\r\n",
            "\t",
            "\0",
            ";",
            "#",
            "\u2028",
            "../x",
            "unknown",
            "nan",
            "inf",
        ),
        *("&a", "*a", "<<: ", "? ", "|\n", "!!python/object:x", "%YAML 1.2", ".nan", "[[model]]"),
        *("'''", "{x={x=1}}", "\0seed=", "1979-05-27", "1e308", "1e400", "4294967296", "-1"),
        *("\nR ", "\nO ", "\nV ", "PAR1", "PK\x01\x02", "PK\x05\x06", "sparse", "uri", "MAT4"),
        *("labelspaces", "layer_names", "withheld", "hidden_share", "class_space", "room|999999"),
    )
)
_TOKEN = re.compile(rb"[-\w.]+")
_LONG = (b"9" * 5_000, b"[" * 2_000, b"{a=" * 1_500, b"\n" * 2_000, b"- " * 1_500)


def is_json(data: bytes) -> bool:
    """Say whether an input may be a JSON document, so that its values can be changed."""
    return data[:1] in b"{[" and len(data) > 1


def change_document(data: bytes, random: random.Random) -> bytes | None:
    """Return a JSON document with some values changed; None if it is none."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return None
    marks: list[str] = []
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        document = _change_one(document, random, marks)
    text = json.dumps(document)
    for number, hostile in enumerate(marks):
        text = text.replace(json.dumps(_mark(number)), hostile)
    return text.encode("utf-8", "replace")


def _mark(number: int) -> str:
    return f"\x7f{number}\x7f"


def _change_one(document: Any, random: random.Random, marks: list[str]) -> Any:
    """Change one place of a document: its value, its key, its absence, its number."""
    places = list(_places(document))
    if not places:
        marks.append(random.choice(_HOSTILE))
        return _mark(len(marks) - 1)
    holder, key = random.choice(places)
    value, what = holder[key], random.randrange(12)
    if what < 7:
        marks.append(random.choice(_HOSTILE))
        holder[key] = _mark(len(marks) - 1)
    elif what == 7:
        del holder[key]
    elif what == 8:  # another value of the document
        other, place = random.choice(places)
        holder[key] = json.loads(json.dumps(other[place]))
    elif isinstance(holder, list):
        holder.insert(key, value)
    elif isinstance(value, str):
        holder[key] = value[: random.randrange(len(value) + 1)]
    elif isinstance(value, int | float):
        holder[key] = value * random.choice((-1, 2, 1_000)) + random.choice((0, 1, -1))
    else:
        del holder[key]
        holder[random.choice(("", "x", "id", str(key).upper()))] = value
    return document


def _places(document: Any) -> list[tuple[Any, Any]]:
    """Return every place of a document that holds a value: a list or an object, and the key."""
    found: list[tuple[Any, Any]] = []
    waiting = [document]
    while waiting and len(found) < 5_000:
        holder = waiting.pop()
        entries = holder.items() if isinstance(holder, dict) else enumerate(holder)
        for key, value in list(entries) if isinstance(holder, dict | list) else []:
            found.append((holder, key))
            if isinstance(value, dict | list):
                waiting.append(value)
    return found


def change_bytes(data: bytes, random: random.Random) -> bytes:
    """Return an input with a few bytes, lines, numbers or words of it changed."""
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 3, 8))):
        at = random.randrange(len(changed) + 1)
        end = min(len(changed), at + random.choice((1, 1, 2, 4, 8, 40)))
        what = random.randrange(8)
        if what == 0 and at < len(changed):
            changed[at] ^= 1 << random.randrange(8)
        elif what == 1 and at < len(changed):
            changed[at] = random.choice((0, 10, 34, 44, 127, 128, 255, 195))
        elif what == 2:
            del changed[at:end]
        elif what == 3:
            changed[at:at] = changed[at:end] * random.choice((1, 2, 50))
        elif what == 4:
            changed[at:at] = random.choice(_WORDS)
        elif what == 5:
            changed[at:end] = random.choice(_WORDS)
        elif what == 6 and (tokens := [*_TOKEN.finditer(changed)]):
            start, end = random.choice(tokens).span()
            changed[start:end] = random.choice(_NUMBERS if random.random() < 0.9 else _LONG)
        else:
            del changed[at + random.randrange(200) :]
    return bytes(changed)


def change(data: bytes, random: random.Random, *, most: int) -> bytes:
    """Return another input that is much like this one."""
    if is_json(data) and random.random() < 0.8:
        changed = change_document(data, random)
        if changed is not None and len(changed) <= most:
            return changed
    return change_bytes(data, random)[:most]
