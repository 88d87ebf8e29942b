"""Load public names of a module on first use, as the stub beside it lists them (PEP 562)."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bsg_data.errors import EXTRA_OF, ask_to_install


def read_stub(module: str, file: str) -> tuple[Callable[[str], Any], list[str]]:
    """Return `__getattr__` and `__all__` of a module; type checkers read the same stub.

    Args:
        module: name of the module or package.
        file: its own file, beside which the stub lies.
    """
    package = module if Path(file).stem == "__init__" else module.rpartition(".")[0]
    tree = ast.parse(Path(file).with_suffix(".pyi").read_text("utf-8"))
    modules = {
        alias.name: f"{package}.{node.module}" if node.level else str(node.module)
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }

    def load(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        try:
            value = getattr(importlib.import_module(modules[name]), name)
        except ModuleNotFoundError as error:
            missing = (error.name or "").partition(".")[0]
            if missing.startswith("bsg_") or not missing:
                raise
            extra = "onnx" if EXTRA_OF.get(missing) == "onnx" else "train"
            raise ModuleNotFoundError(
                f"{missing} is not installed; {package} needs it: {ask_to_install(extra)}",
                name=error.name,
            ) from error
        setattr(sys.modules[module], name, value)  # found without this function from now on
        return value

    return load, sorted(modules)
