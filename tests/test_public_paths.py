"""Every public function that takes a path takes text too, as `open` does."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

import bsg_data
import bsg_models

# Classes whose objects the project makes; a user reads them, and calls none with a path.
MADE_BY_US = {
    "BeliefReport",
    "Dataset",
    "EvaluationReport",
    "FormatRow",
    "FoundModel",
    "LeaderboardReport",
    "RunSummary",
    "SearchReport",
}


def public_calls() -> Iterator[tuple[str, Callable[..., Any], dict[str, str]]]:
    """Yield every public function, class and class method with its annotations, as text."""
    for root in (bsg_data, bsg_models):
        for name in root.__all__:
            public = getattr(root, name)
            if inspect.isfunction(public):
                yield f"{root.__name__}.{name}", public, annotations_of(public)
            elif inspect.isclass(public) and not issubclass(public, BaseModel | BaseException):
                if name not in MADE_BY_US:
                    yield f"{root.__name__}.{name}", public, annotations_of(public.__init__)
                for method, kept in vars(public).items():
                    if isinstance(kept, classmethod) and not method.startswith("_"):
                        bound = getattr(public, method)
                        yield f"{root.__name__}.{name}.{method}", bound, annotations_of(bound)


def annotations_of(call: Callable[..., Any]) -> dict[str, str]:
    try:
        parameters = inspect.signature(call).parameters.values()
    except (TypeError, ValueError):  # a class without an initialiser of its own
        return {}
    return {
        p.name: p.annotation
        if isinstance(p.annotation, str)
        else inspect.formatannotation(p.annotation)
        for p in parameters
        if p.annotation is not p.empty
    }


def names_in(annotation: str) -> set[str]:
    return set(re.findall(r"\w+", annotation))


CALLS = list(public_calls())


@pytest.mark.parametrize(("where", "annotations"), [(where, a) for where, _, a in CALLS])
def test_a_public_function_does_not_ask_for_path_objects(
    where: str, annotations: dict[str, str]
) -> None:
    asking = [name for name, said in annotations.items() if "Path" in names_in(said)]
    assert asking == [], f"{where}: declare them as bsg_data.files.AnyPath, and convert them first"


# What follows reads the code: a call with missing files may fail before it uses its path.
def list_functions(tree: ast.AST, owner: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield every function with the name that calls it; a class calls its initialiser."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield owner if node.name == "__init__" else f"{owner}.{node.name}".strip("."), node
        yield from list_functions(node, node.name if isinstance(node, ast.ClassDef) else owner)


def arguments_of(function: ast.FunctionDef) -> list[tuple[str, bool]]:
    """Return the arguments that callers give, those by position first, and whether paths."""
    own = function.args
    given = [a for a in own.posonlyargs + own.args + own.kwonlyargs if a.arg not in ("self", "cls")]
    return [
        (a.arg, a.annotation is not None and "AnyPath" in names_in(ast.unparse(a.annotation)))
        for a in given
    ]


FUNCTIONS = [
    (name, function)
    for package in ("bsg_data", "bsg_models")
    for file in sorted((Path(__file__).parents[1] / package).rglob("*.py"))
    for name, function in list_functions(ast.parse(file.read_text(encoding="utf-8")))
]
TAKERS = {
    name.split(".")[-1]: arguments_of(function)
    for name, function in FUNCTIONS
    if any(is_path for _, is_path in arguments_of(function))
}
PATHS = [
    pytest.param(function, argument, id=f"{name}-{argument}")
    for name, function in FUNCTIONS
    for argument, is_path in arguments_of(function)
    if is_path
]


def unconverted(function: ast.FunctionDef, name: str) -> list[str]:
    """Return the lines that use a path without converting it, or handing it on as an `AnyPath`.

    After `name = Path(name)` in the function's own body, it is a path object.
    """
    found: list[str] = []
    for statement in function.body:
        names = {name} | set(items_of(statement, name))
        allowed = set(allowed_uses(statement))
        found += [
            f"line {node.lineno}: {node.id}"
            for node in ast.walk(statement)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)
            if node.id in names and node not in allowed
        ]
        if isinstance(statement, ast.Assign) and name in stored_in(*statement.targets):
            break
    return found


def stored_in(*targets: ast.AST) -> set[str]:
    return {n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)}


def items_of(statement: ast.stmt, name: str) -> Iterator[str]:
    """Yield the names that the items of a collection of paths get."""
    for node in ast.walk(statement):
        if isinstance(node, ast.comprehension | ast.For) and name in stored_in(node.iter):
            target = node.target  # of a mapping, a key, which is no path, and a path
            yield from stored_in(target.elts[-1] if isinstance(target, ast.Tuple) else target)


def allowed_uses(statement: ast.stmt) -> Iterator[ast.AST]:
    """Yield the nodes that convert what they hold, hand it on as a path, or ask what it is."""
    for node in ast.walk(statement):
        if isinstance(node, ast.Call):
            yield from allowed_arguments(node)
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot):
            yield node.left
        elif isinstance(node, ast.comprehension | ast.For):
            yield from ast.walk(node.iter)
        elif isinstance(node, ast.If | ast.IfExp) and is_kind(node.test):
            body = node.body if isinstance(node.body, list) else [node.body]
            yield from (inner for part in body for inner in ast.walk(part))


def is_kind(test: ast.expr) -> bool:
    """Whether a condition holds only for what is no path object."""
    names = stored_in(test)
    return isinstance(test, ast.Call) and "isinstance" in names and "os" not in names


def allowed_arguments(call: ast.Call) -> Iterator[ast.AST]:
    called = ast.unparse(call.func)
    if called in ("Path", "os.fspath", "isinstance", "show_value"):
        yield from call.args
    taken = TAKERS.get(called.split(".")[-1], [])
    yield from (given for given, (_, is_path) in zip(call.args, taken, strict=False) if is_path)
    yield from (given.value for given in call.keywords if (given.arg, True) in taken)


@pytest.mark.parametrize(("function", "name"), PATHS)
def test_a_path_is_converted_before_it_is_used(function: ast.FunctionDef, name: str) -> None:
    assert unconverted(function, name) == []
