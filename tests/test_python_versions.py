"""Nothing is used that Python 3.10, of ROS 2 Humble, has not: most tests run on a later one.

Syntax is checked by ruff, whose `target-version` is the oldest Python. Here are names of the
standard library; `tomllib` is imported only where the version was asked for.
"""

from __future__ import annotations

import ast

from conftest import REPOSITORY

LATER = {  # module → names that it has from Python 3.11 or 3.12 on
    "asyncio": "Runner TaskGroup Timeout timeout timeout_at",
    "collections.abc": "Buffer",
    "contextlib": "chdir",
    "datetime": "UTC",
    "enum": "EnumCheck ReprEnum StrEnum member nonmember property verify",
    "hashlib": "file_digest",
    "itertools": "batched",
    "math": "cbrt exp2 sumprod",
    "operator": "call",
    "typing": "LiteralString Never NotRequired Required Self TypeAliasType TypeVarTuple Unpack "
    "assert_never assert_type dataclass_transform override reveal_type",
}
NAMES = {f"{module}.{name}" for module, names in LATER.items() for name in names.split()}
METHODS = {"add_note", "with_segments"}  # names of methods that Python 3.10 has on nothing


def find_later(source: str) -> set[str]:
    """Return what a source uses that Python 3.10 has not."""
    used = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            used |= {f"{node.module}.{one.name}" for one in node.names}
        elif isinstance(node, ast.Attribute):
            named = node.attr in METHODS
            used.add(node.attr if named else f"{ast.unparse(node.value)}.{node.attr}")
        elif isinstance(node, ast.Name):
            used.add(node.id)
    return used & (NAMES | METHODS | {"ExceptionGroup", "BaseExceptionGroup"})


def test_nothing_is_used_that_the_oldest_python_has_not() -> None:
    assert find_later("from typing import Self\nhashlib.file_digest(x)") == {
        "typing.Self",
        "hashlib.file_digest",
    }
    for folder in ("bsg_data", "bsg_models", "cli", "docs/examples"):
        for path in (REPOSITORY / folder).rglob("*.py"):
            assert not find_later(path.read_text("utf-8")), path
