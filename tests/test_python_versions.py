"""Nothing is used that Python 3.10, of ROS 2 Humble, has not: most tests run on a later one.

Syntax is checked by ruff, whose `target-version` is the oldest Python. Here are names of the
standard library.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from conftest import REPOSITORY

OLDEST = (3, 10)
LATER = {  # module → names that it has from Python 3.11 or 3.12 on
    "asyncio": "Runner TaskGroup Timeout timeout timeout_at",
    "builtins": "BaseExceptionGroup ExceptionGroup",
    "calendar": "Day Month",
    "collections.abc": "Buffer",
    "contextlib": "chdir",
    "datetime": "UTC",
    "enum": "EnumCheck FlagBoundary ReprEnum StrEnum global_enum member nonmember property verify",
    "hashlib": "file_digest",
    "inspect": "getasyncgenstate getmembers_static ismethodwrapper markcoroutinefunction",
    "itertools": "batched",
    "logging": "getHandlerByName getLevelNamesMapping",
    "math": "cbrt exp2 sumprod",
    "operator": "call",
    "statistics": "kde",
    "sys": "exception monitoring",
    "tomllib": "load loads TOMLDecodeError",
    "typing": "LiteralString Never NotRequired Required Self TypeAliasType TypeVarTuple Unpack "
    "assert_never assert_type clear_overloads dataclass_transform get_overloads override "
    "reveal_type",
}
METHODS = {"add_note", "with_segments"}  # names of methods that Python 3.10 has on nothing
NAMES = {module: set(names.split()) for module, names in LATER.items()}
SOURCES = [
    *(REPOSITORY / "bsg_data").rglob("*.py"),
    *(REPOSITORY / "bsg_models").rglob("*.py"),
    *(REPOSITORY / "cli").rglob("*.py"),
    *(REPOSITORY / "docs" / "examples").rglob("*.py"),
]


def find_later(source: str) -> Iterator[str]:
    """Yield what a source uses that Python 3.10 has not, unless it asks for the version."""
    tree = ast.parse(source)
    asked = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "sys.version_info" in ast.unparse(node.test)
        for part in node.body
        for inner in ast.walk(part)
    }
    for node in ast.walk(tree):
        if node in asked:
            continue
        if isinstance(node, ast.ImportFrom):
            yield from (
                f"{node.module}.{one.name}"
                for one in node.names
                if one.name in NAMES.get(node.module or "", ())
            )
        elif isinstance(node, ast.Import):
            yield from (one.name for one in node.names if one.name == "tomllib")
        elif isinstance(node, ast.Attribute):
            module = ast.unparse(node.value)
            if node.attr in METHODS or (module != "tomllib" and node.attr in NAMES.get(module, ())):
                yield f"{module}.{node.attr}"
        elif isinstance(node, ast.Name) and node.id in NAMES["builtins"]:
            yield node.id


def test_nothing_is_used_that_the_oldest_python_has_not() -> None:
    found = {
        path.relative_to(REPOSITORY).as_posix(): later
        for path in SOURCES
        if (later := list(find_later(path.read_text("utf-8"))))
    }
    assert found == {}


def test_what_the_oldest_python_has_not_is_found() -> None:
    source = """
import sys, hashlib, tomllib
from typing import Any, Self
if sys.version_info >= (3, 11):
    from enum import StrEnum
hashlib.file_digest(file, "sha256")
error.add_note("more")
raise ExceptionGroup("", [])
"""
    assert sorted(find_later(source)) == [
        "ExceptionGroup",
        "error.add_note",
        "hashlib.file_digest",
        "tomllib",
        "typing.Self",
    ]
