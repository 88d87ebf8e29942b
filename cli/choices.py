"""The names that helps list, options accept and shells complete, without slow imports.

A registry knows its names without importing its rows, so a help text does not wait for torch.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from bsg_data.errors import BSGError
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.registry import require_known
from bsg_data.scene.class_map import published_maps
from bsg_data.scene.class_space import DEFAULT_CLASS_SPACE, load_class_space
from bsg_models.zoo.catalogue import RECIPES, ZOO

if TYPE_CHECKING:
    from bsg_models.zoo.config import RunConfig


def load_config(name: str) -> RunConfig:
    """Return the configuration of a zoo name or a TOML file."""
    return load_run(name, ())[0]


def load_run(name: str, settings: tuple[str, ...]) -> tuple[RunConfig, Path | None, Path | None]:
    """Return the configuration of a zoo name or a TOML file with its overrides, and two paths.

    The paths are `dataset` and `out`, which may stand at the top of the file.
    """
    # Imported here: a help must not wait for it.
    from bsg_models.zoo.config import find_config, override, read_config, validate_config

    known = (*RECIPES, *ZOO)
    if name in known or not (name.endswith(".toml") or Path(name).is_file()):
        require_known("model", [name], known)
        tables = find_config(name).model_dump(mode="json")
    else:
        tables = read_config(Path(name))
    source = f"--config {name}" + (" with its --set" if settings else "")
    tables = override(tables, settings)
    dataset, out = (_take_path(tables, key, source) for key in ("dataset", "out"))
    return validate_config(tables, source=source), dataset, out


def _take_path(tables: dict[str, Any], key: str, source: str) -> Path | None:
    value = tables.pop(key, None)
    if value is None:
        return None
    if not isinstance(value, str) or not value:
        raise click.UsageError(f"{source}: {key}: expected a path in quotes, found {value!r:.80}")
    return Path(value)


_Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def complete_list(names: Callable[[click.Context], Iterable[str]]) -> _Complete:
    """Return a completer for the last name of a list; earlier options may decide the names."""

    def complete(ctx: click.Context, _: click.Parameter, text: str) -> list[CompletionItem]:
        before, comma, begun = text.rpartition(",")
        found = (name for name in names(ctx) if name.startswith(begun))
        return [CompletionItem(f"{before}{comma}{name}") for name in found]

    return complete


def complete_names_or_files(names: Callable[[], Iterable[str]]) -> _Complete:
    """Return a completer for one name or a path."""

    def complete(ctx: click.Context, _: click.Parameter, text: str) -> list[CompletionItem]:
        found = (CompletionItem(name) for name in names() if name.startswith(text))
        return [CompletionItem(text, type="file"), *found]

    return complete


def _list_shipped() -> tuple[str, ...]:
    from bsg_models.runs.found_model import shipped_names

    return shipped_names()


complete_model = complete_names_or_files(_list_shipped)
complete_class_map = complete_names_or_files(published_maps)


def classes_of_dataset(ctx: click.Context) -> tuple[str, ...]:
    """Return the classes of the dataset on the command line, or the default classes.

    The manifest is read as plain JSON because the code that validates it is slow to import.
    """
    try:
        path = Path(ctx.params["dataset"]) / "dataset.json"
        data = read_bytes(path)
        return tuple(map(str, json.loads(data)["class_space"]["classes"]))
    except (BSGError, ValueError, KeyError, TypeError, RecursionError):
        return load_class_space(DEFAULT_CLASS_SPACE).classes
