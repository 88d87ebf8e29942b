"""Every public function that takes a path takes text too, as `open` does."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
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
PATHS = [
    pytest.param(call, name, annotations[name], id=f"{where}-{name}")
    for where, call, annotations in CALLS
    for name in annotations
    if "AnyPath" in names_in(annotations[name])
]


@pytest.mark.parametrize(("where", "annotations"), [(where, a) for where, _, a in CALLS])
def test_a_public_function_does_not_ask_for_path_objects(
    where: str, annotations: dict[str, str]
) -> None:
    asking = [name for name, said in annotations.items() if "Path" in names_in(said)]
    assert asking == [], f"{where}: declare them as bsg_data.files.AnyPath, and convert them first"


@dataclass(frozen=True)
class Place:
    """A path of another library, such as `py.path.local`."""

    path: str

    def __fspath__(self) -> str:
        return self.path


def wrap(annotation: str, path: str | os.PathLike[str]) -> object:
    """Return a path, or a collection of it if the parameter is one."""
    if annotation.startswith("Sequence"):
        return [path, path]
    return {"house": path} if annotation.startswith("Mapping") else path


def fill(parameter: inspect.Parameter, folder: Path) -> object:
    """Return a value for another parameter that a call needs; a new kind of it gets a row here."""
    annotation = str(parameter.annotation)
    if "AnyPath" in names_in(annotation):
        return wrap(annotation, folder / "there")
    values: dict[str, object] = {
        "belief": None,
        "beliefs": [],
        "board": None,
        "checkpoint": None,
        "class_map": bsg_data.load_class_map(),
        "class_space": bsg_data.ClassSpaceEntry.of(bsg_data.load_class_space()),
        "config": bsg_models.find_config("doubled"),
        "draw": 0,
        "force": False,
        "frame": pd.DataFrame(),
        "graph": None,
        "graphs": [],
        "mask": bsg_data.MaskRecipe(),
        "models": {},
        "name": "hm3d",
        "part": bsg_data.Part(1, 1) if annotation == "Part" else 0,
        "planners": None,
        "recipe": None,
        "runs": {},
        "scenes": 1 if annotation == "int" else [],
        "seed": 0,
        "source": bsg_data.HM3DFolder(folder / "there"),
        "split": "train",
        "title": "title",
        "to": "habitat",
        "views": [],
    }
    return values[parameter.name]


def outcome(call: Callable[..., Any], arguments: dict[str, object], folder: Path) -> str:
    """Return what a call returns or raises; a generator is run to its end."""
    try:
        done = call(**arguments)
        said = repr(list(done) if inspect.isgenerator(done) else done)
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
    return re.sub("0x[0-9a-f]+", "ADDRESS", said.replace(str(folder), "FOLDER"))


@pytest.mark.parametrize(("call", "name", "annotation"), PATHS)
def test_text_does_as_a_path_object_does(
    call: Callable[..., Any], name: str, annotation: str, tmp_path: Path
) -> None:
    parameters = inspect.signature(call).parameters.values()
    told = set()
    for number, kind in enumerate((Path, str, Place)):
        folder = tmp_path / str(number)
        folder.mkdir()
        needed = [
            p
            for p in parameters
            if p.name != name and p.default is p.empty and p.kind is not p.VAR_KEYWORD
        ]
        arguments = {p.name: fill(p, folder) for p in needed}
        path = os.path.join(folder, "none.json")  # noqa: PTH118 -- text is what is tried
        told.add(outcome(call, arguments | {name: wrap(annotation, kind(path))}, folder))
    assert len(told) == 1, told
