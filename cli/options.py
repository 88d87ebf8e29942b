"""The options that several commands share."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import click

import bsg_data
from bsg_cli.choices import MASKS, complete_class_map, complete_model
from bsg_cli.terminal import Workers
from bsg_data.errors import RecipeError
from bsg_data.registry import Registry
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP

Function = TypeVar("Function", bound=Callable[..., Any])
Decorator = Callable[[Function], Function]


class Fraction(click.FloatRange):
    """A number from 0 to 1; `nan` is refused."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number, or refuse it."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"expected a number from 0 to 1, found {value}", param, ctx)
        return float(number)


class RegistryChoice(click.Choice[str]):
    """One name of a registry; the names are read only when the option is used."""

    def __init__(self, registry: Registry[Any]) -> None:
        super().__init__(registry.names())
        self._registry = registry

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name, or refuse it and list the nearest and all known names."""
        self.choices = self._registry.names()
        try:
            self._registry.require([value])
        except RecipeError as error:
            self.fail(str(error), param, ctx)
        return super().convert(value, param, ctx)


PATH = click.Path(path_type=Path)


class PagePath(click.Path):
    """The path of an HTML page that a command writes."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path; refuse one that a browser would not open as a page."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.suffix.casefold() not in (".html", ".htm"):
            self.fail(f"{path}: expected the name of a page, such as page.html", param, ctx)
        return path


class DatasetPath(click.Path):
    """The path of a dataset that a command reads; one that is missing or damaged is refused."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Read the manifest, before slow modules are imported, and return the path."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if ctx is None or not ctx.resilient_parsing:  # a shell that completes waits for nothing
            bsg_data.read_manifest(path)
        return path


MOST_WORKERS = 1024  # each is a process; one machine has no use for more
json_option = click.option("as_json", "--json", is_flag=True, help="Print JSON on stdout.")
force_option = click.option("--force", is_flag=True, help="Replace a finished result.")


def workers_option(function: Function) -> Function:
    """Add `--workers` and `--scheduler`; the command gets both as `workers`, a `Workers`."""

    @click.option(
        "--workers",
        type=click.IntRange(1, MOST_WORKERS),
        show_default="all cores",
        help="Number of processes. The result does not depend on it.",
    )
    @click.option(
        "--scheduler",
        metavar="ADDRESS|FILE",
        help="Dask scheduler. Its workers must see the same files at the same paths.",
    )
    @wraps(function)
    def command(
        *args: Any, workers: int | None = None, scheduler: str | None = None, **options: Any
    ) -> Any:
        if workers is not None and scheduler is not None:
            raise click.UsageError(
                "--workers and --scheduler exclude each other: --workers starts processes on this "
                "machine; give one of them"
            )
        chosen = Workers(workers or os.cpu_count() or 1, scheduler)
        return function(*args, workers=chosen, **options)

    return cast(Function, command)


dataset_argument = click.argument("dataset", type=DatasetPath(), metavar="DATASET")
class_map_option = click.option(
    "--class-map",
    default=DEFAULT_CLASS_MAP,
    show_default=True,
    help="A published version, or the path of your own NAME.csv.",
    shell_complete=complete_class_map,
)
source_map_option = click.option(
    "--class-map",
    help="A published version, or the path of your own NAME.csv.  [default: the source's]",
    shell_complete=complete_class_map,
)


def data_option(text: str, *, required: bool = True) -> Decorator[Any]:
    """Return `--data`, the dataset for a command that uses models."""
    return click.option("--data", "dataset", type=DatasetPath(), required=required, help=text)


def model_option(text: str, *, multiple: bool = False) -> Decorator[Any]:
    """Return `--model`: a shipped model, a run, or a model of the hub."""
    return click.option(
        "--model",
        metavar="NAME|FOLDER|HUB-ID",
        multiple=multiple,
        help=text,
        shell_complete=complete_model,
    )


def out_option(text: str, *, required: bool = False) -> Decorator[Any]:
    """Return `--out`, the path of the result."""
    return click.option("--out", type=PATH, required=required, help=text)


def seed_option(text: str = "Random seed.") -> Decorator[Any]:
    """Return `--seed`."""
    return click.option(
        "--seed", type=click.IntRange(min=0), default=0, show_default=True, help=text
    )


def split_option(text: str, *, default: str, more: tuple[str, ...] = ()) -> Decorator[Any]:
    """Return `--split`, which selects the buildings."""
    names = click.Choice(["train", "val", "test", *more])
    return click.option("--split", type=names, default=default, show_default=True, help=text)


def mask_options(how: str, how_much: str, *, min_open: bool = False) -> Decorator[Any]:
    """Return `--mask`, `--fraction`, `--withhold` and `--parts`, which say how to hide objects."""

    def decorate(function: Function) -> Function:
        fraction = click.option(
            "--fraction",
            type=Fraction(0, 1, min_open=min_open),
            default=0.5,
            show_default=True,
            help=how_much,
        )
        withhold = click.option(
            "--withhold",
            type=Fraction(0, 1),
            default=0.0,
            show_default=True,
            help="Share of the classes to hide everywhere except in searched rooms.",
        )
        parts = click.option(
            "--parts",
            is_flag=True,
            help="Hide the parts of hidden objects: the curtain rod of a hidden curtain.",
        )
        mask = click.option(
            "--mask", type=RegistryChoice(MASKS), default="uniform", show_default=True, help=how
        )
        return mask(fraction(withhold(parts(function))))

    return decorate


def resamples_option(default: int) -> Decorator[Any]:
    """Return `--resamples`, the number of bootstrap resamples."""
    return click.option(
        "--resamples",
        type=click.IntRange(min=0),
        default=default,
        show_default=True,
        help="Bootstrap resamples of the buildings; 0: no intervals.",
    )


def split_names(text: str | None, *, option: str) -> tuple[str, ...] | None:
    """Return the unique names of a list with commas; None if the option is not given."""
    if text is None:
        return None
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise click.UsageError(f"{option} names nothing; expected names with commas between them")
    return names
