"""Complete names in a shell without slow imports.

A list with commas is completed after its last comma.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path

import click
from click.shell_completion import CompletionItem

import bsg_models
from bsg_data.errors import BSGError
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import MANIFEST_FILE
from bsg_data.scene.class_map import list_class_maps
from bsg_data.scene.class_space import DEFAULT_CLASS_SPACE, load_class_space

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def complete_list(names: Callable[[click.Context], Iterable[str]]) -> Complete:
    """Return a completer for the last name of a list; earlier options may decide the names."""

    def complete(ctx: click.Context, _: click.Parameter, text: str) -> list[CompletionItem]:
        before, comma, begun = text.rpartition(",")
        return [CompletionItem(f"{before}{comma}{name}") for name in _fitting(names(ctx), begun)]

    return complete


def complete_names_or_files(names: Callable[[], Iterable[str]]) -> Complete:
    """Return a completer for one name or a path."""

    def complete(ctx: click.Context, _: click.Parameter, text: str) -> list[CompletionItem]:
        found = [CompletionItem(name) for name in _fitting(names(), text)]
        return [CompletionItem(text, type="file"), *found]

    return complete


def _shipped_models() -> tuple[str, ...]:
    """Return the names of the shipped models; no names if their list is damaged."""
    try:
        return bsg_models.shipped_names()
    except BSGError:
        return ()


complete_model = complete_names_or_files(_shipped_models)
complete_class_map = complete_names_or_files(list_class_maps)


def classes_of_dataset(ctx: click.Context) -> tuple[str, ...]:
    """Return the classes of the dataset on the command line, or the default classes.

    The manifest is read as plain JSON because the code that validates it is slow to import.
    """
    try:
        path = Path(ctx.params["dataset"]) / "dataset.json"
        data = read_bytes(path, MANIFEST_FILE)
        return tuple(map(str, json.loads(data)["class_space"]["classes"]))
    except (BSGError, ValueError, KeyError, TypeError, RecursionError):
        return load_class_space(DEFAULT_CLASS_SPACE).classes


def _fitting(names: Iterable[str], begun: str) -> list[str]:
    return [name for name in names if name.startswith(begun)]
