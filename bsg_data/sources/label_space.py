"""Label spaces: what the numbers and the names of a robot's labels stand for.

A published one translates the names of a public data set into categories of HM3D
(`mappings/labels-<name>.csv`: `number,label,category`). Its numbers are those of Hydra's label
space of that data set, and count where a file names no label itself. One of your own says which
name a number stands for: Hydra's YAML, with a list `label_names` of `{label: 5, name: chair}`, or a
CSV with the columns `label,name` and, if names are to be translated too, `category`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from bsg_data.errors import ClassMapError, SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.documents import parse_yaml
from bsg_data.inputs.text_table import parse_csv
from bsg_data.records import ForeignRecord, Listed, name_fault
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.sources.dsg_file import DSGNode

_PREFIX, _SUFFIX = "labels-", ".csv"


class _Label(ForeignRecord):
    label: Annotated[int, Field(ge=0, lt=2**32)]
    name: Annotated[str, Field(max_length=200)]
    category: Annotated[str, Field(max_length=200)] = ""


class _HydraFile(ForeignRecord):
    label_names: Annotated[Listed[_Label], Field(min_length=1)]


@dataclass(frozen=True, slots=True)
class LabelSpace:
    """What the labels of a robot stand for."""

    name: str  # of the space, or of its file
    sha256: str  # of its bytes
    # the names of numbers, whatever a file says of them; empty in a published space
    names: Mapping[int, str]
    categories: Mapping[str, str]  # the categories of names, where they are translated
    # in a published space the names of numbers, where a file says nothing of them
    usual: Mapping[int, str] = field(default_factory=dict)

    def translate(self, name: str) -> str:
        """Return the category that a name stands for; the name itself where none is given."""
        return self.categories.get(name, name)


def _list_label_spaces() -> tuple[str, ...]:
    """Return the names of the published label spaces, sorted."""
    names = sorted(item.name for item in files("bsg_mappings").iterdir())
    return tuple(n[len(_PREFIX) : -len(_SUFFIX)] for n in names if n.startswith(_PREFIX))


@cache
def _read_published(name: str) -> LabelSpace:
    if name not in _list_label_spaces():
        raise ClassMapError(
            f"no label space {name!r}: known are {', '.join(_list_label_spaces())}, and yours as "
            "the path of a .yaml, .yml or .csv",
            code="label-space-unknown",
            where=name,
        )
    data = read_published(f"{_PREFIX}{name}{_SUFFIX}")
    rows = read_rows(name, data, ("number", "label", "category"))
    return LabelSpace(
        name=name,
        sha256=hashlib.sha256(data).hexdigest(),
        names={},
        categories={label: category for _, (_, label, category) in rows},
        usual={int(number): label for _, (number, label, _) in rows},
    )


def load_label_space(name: AnyPath) -> LabelSpace:
    """Load a published label space by its name, or one of your own by its path.

    Args:
        name: `ade20k`, `mpcat40`, or the path of a `.yaml`, `.yml` or `.csv`.
    """
    path = Path(name)
    if path.suffix.casefold() not in (".yaml", ".yml", _SUFFIX):
        return _read_published(os.fspath(name))
    data = read_bytes(path)
    try:
        is_csv = path.suffix.casefold() == _SUFFIX
        document = {"label_names": _parse_csv(data)} if is_csv else parse_yaml(data)
        labels = _HydraFile.model_validate(document).label_names
        names: dict[int, str] = {}
        for label in labels:
            if names.setdefault(label.label, label.name) != label.name:
                raise ValueError(f"label {label.label} has two names")
    except ValueError as error:
        fault = name_fault(error) if isinstance(error, ValidationError) else error
        raise SourceError(
            f"{path}: {fault}; expected Hydra's label_names, a list of {{label: 5, name: chair}}, "
            "or a CSV with the columns label,name",
            code="label-space-malformed",
            where=path,
        ) from error
    categories = {label.name: label.category for label in labels if label.category}
    return LabelSpace(path.stem, hashlib.sha256(data).hexdigest(), names, categories)


def _parse_csv(data: bytes) -> list[dict[str, Any]]:
    header, *rows = [row for _, row in parse_csv(data) if row] or [[]]
    pairs = (zip(header, row, strict=False) for row in rows)
    return [{key: cell for key, cell in pair if key and cell} for pair in pairs]


def name_object(node: DSGNode, space: LabelSpace | None) -> str:
    """Return the name of an object: of its label by the space, by the file, else its own.

    A published space names a label's number where neither the file nor the object has a name. An
    own name loses its number, `chair_3` for example. A label that nobody names is `label 5`, so
    that a build reports it; an object without either has no name.
    """
    own = (node.name or "").rstrip("0123456789").rstrip("_ #-")
    if node.label is None:
        name = own
    elif space is None:
        name = node.label_name or own or f"label {node.label}"
    else:
        given = space.names.get(node.label) or node.label_name or own
        name = given or space.usual.get(node.label) or f"label {node.label}"
    return name if space is None else space.translate(name)
