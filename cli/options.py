"""The options that several commands have, each defined once."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import click

from bsg_cli.choices import MASKS
from bsg_cli.completion import complete_class_map, complete_model
from bsg_cli.dataset_paths import DatasetPath
from bsg_cli.terminal import Workers
from bsg_data.errors import RecipeError
from bsg_data.registry import Registry
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP

Function = TypeVar("Function", bound=Callable[..., Any])
Decorator = Callable[[Function], Function]


class Fraction(click.FloatRange):
    """A number from 0 to 1; `nan` is none, though no comparison would refuse it."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number, or refuse it."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} is no number", param, ctx)
        return float(number)


class RegistryChoice(click.Choice[str]):
    """One of the names of a registry, which are read when a name is given."""

    def __init__(self, registry: Registry[Any]) -> None:
        super().__init__(registry.names())
        self._registry = registry

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name, or refuse it with the nearest and those that are known."""
        self.choices = self._registry.names()
        try:
            self._registry.require([value])
        except RecipeError as error:
            self.fail(str(error), param, ctx)
        return super().convert(value, param, ctx)


PATH = click.Path(path_type=Path)
MOST_WORKERS = 1024  # far more than a machine does well with, and each is a process
json_option = click.option("as_json", "--json", is_flag=True, help="Print JSON on stdout.")
force_option = click.option("--force", is_flag=True, help="Replace a finished result.")


def workers_option(function: Function) -> Function:
    """Give a command `--workers` and `--scheduler`; it gets both as `workers`, one `Workers`."""

    @click.option(
        "--workers",
        type=click.IntRange(1, MOST_WORKERS),
        show_default="all cores",
        help="Processes to use; the result does not depend on it.",
    )
    @click.option(
        "--scheduler",
        metavar="ADDRESS|FILE",
        help="Dask scheduler whose workers do the work; they see the same files at the same paths.",
    )
    @wraps(function)
    def command(
        *args: Any, workers: int | None = None, scheduler: str | None = None, **options: Any
    ) -> Any:
        if workers is not None and scheduler is not None:
            raise click.UsageError("--workers is of this machine: --scheduler excludes it")
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
    """Return `--data`, the dataset of a command that works with models."""
    return click.option("--data", "dataset", type=DatasetPath(), required=required, help=text)


def model_option(text: str, *, multiple: bool = False) -> Decorator[Any]:
    """Return `--model`, and `--run`, its older spelling, which takes a path alone."""

    def decorate(function: Function) -> Function:
        model = click.option(
            "--model",
            metavar="NAME|FOLDER|HUB-ID",
            multiple=multiple,
            help=text,
            shell_complete=complete_model,
        )
        run = click.option(
            "--run", type=PATH, multiple=multiple, help="The folder of a run, whatever its name."
        )
        return model(run(function))

    return decorate


def read_model(model: str | None, run: Path | None) -> Path | str | None:
    """Return the model that is named by either spelling; None where neither is.

    Raises:
        click.UsageError: for both.
    """
    if model is not None and run is not None:
        raise click.UsageError("--run is another spelling of --model; give one of them")
    return model if run is None else run


def out_option(text: str, *, required: bool = False) -> Decorator[Any]:
    """Return `--out`, where the result is written."""
    return click.option("--out", type=PATH, required=required, help=text)


def seed_option(text: str = "Seed of all chance.") -> Decorator[Any]:
    """Return `--seed`."""
    return click.option(
        "--seed", type=click.IntRange(min=0), default=0, show_default=True, help=text
    )


def split_option(text: str, *, default: str, more: tuple[str, ...] = ()) -> Decorator[Any]:
    """Return `--split`, whose buildings a command works on."""
    names = click.Choice(["train", "val", "test", *more])
    return click.option("--split", type=names, default=default, show_default=True, help=text)


def mask_options(how: str, how_much: str, *, min_open: bool = False) -> Decorator[Any]:
    """Return `--mask`, `--fraction`, `--withhold` and `--parts`: how objects are hidden."""

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
            help="Share of the classes of which nothing is shown outside searched rooms.",
        )
        parts = click.option(
            "--parts", is_flag=True, help="Hide parts of a thing, as a curtain rod, with the thing."
        )
        mask = click.option(
            "--mask", type=RegistryChoice(MASKS), default="uniform", show_default=True, help=how
        )
        return mask(fraction(withhold(parts(function))))

    return decorate


def resamples_option(default: int) -> Decorator[Any]:
    """Return `--resamples`, of the bootstrap."""
    return click.option(
        "--resamples",
        type=click.IntRange(min=0),
        default=default,
        show_default=True,
        help="Bootstrap resamples of the buildings; 0 for no intervals.",
    )


def split_names(text: str | None, *, option: str) -> tuple[str, ...] | None:
    """Return the names of a list with commas, each once; None where none is given."""
    if text is None:
        return None
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise click.UsageError(f"{option} names nothing")
    return names
