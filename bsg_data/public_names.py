"""Load public names of a package on first use, as its stub `__init__.pyi` lists them (PEP 562)."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def read_stub(package: str, file: str) -> tuple[Callable[[str], Any], list[str]]:
    """Return `__getattr__` and `__all__` of a package; type checkers read the same stub.

    Args:
        package: name of the package.
        file: its `__init__.py`, beside which the stub lies.
    """
    tree = ast.parse(Path(file).with_suffix(".pyi").read_text("utf-8"))
    places = {
        alias.name: f"{package}.{node.module}"
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }

    def load(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(places[name]), name)
        setattr(sys.modules[package], name, value)  # found without this function from now on
        return value

    return load, sorted(places)
