"""The options that several commands share."""

from __future__ import annotations

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
PATH = click.Path(path_type=Path)
MOST_WORKERS = 1024  # each is a process; one machine has no use for more


class RegistryChoice(click.Choice[str]):
    """One name of a registry."""

    def __init__(self, registry: Registry[Any]) -> None:
        super().__init__(registry.names())
        self._registry = registry

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name, or refuse it and list the nearest and all known names."""
        try:
            self._registry.require([value])
        except RecipeError as error:
            self.fail(str(error), param, ctx)
        return str(value)


def require_datasets(
    ctx: click.Context, _: click.Parameter, value: Path | tuple[Path, ...] | None
) -> Any:
    """Read the manifests of datasets before slow modules are imported; a callback of options."""
    if not ctx.resilient_parsing:  # a shell that completes waits for nothing
        for path in value if isinstance(value, tuple) else filter(None, [value]):
            bsg_data.read_manifest(path)
    return value


def _require_page(_: click.Context, __: click.Parameter, path: Path | None) -> Path | None:
    if path is not None and path.suffix.casefold() not in (".html", ".htm"):
        raise click.BadParameter(f"{path}: expected the name of a page, such as page.html")
    return path


def _require_recording(_: click.Context, __: click.Parameter, path: Path | None) -> Path | None:
    if path is None:
        return None
    if path.suffix.casefold() != ".rrd":
        raise click.BadParameter(f"{path}: expected the name of a recording, such as belief.rrd")
    from bsg_models.rendering.recording import require_rerun

    require_rerun()
    return path


json_option = click.option("as_json", "--json", is_flag=True, help="Print JSON on stdout.")
force_option = click.option("--force", is_flag=True, help="Replace a finished result.")
dataset_argument = click.argument(
    "dataset", type=PATH, callback=require_datasets, metavar="DATASET"
)
class_map_option = click.option(
    "--class-map",
    default=DEFAULT_CLASS_MAP,
    show_default=True,
    help="A published version, or the path of your own NAME.csv.",
    shell_complete=complete_class_map,
)


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


def data_option(text: str, *, required: bool = True) -> Decorator[Any]:
    """Return `--data`, the dataset for a command that uses models."""
    how: Any = {"type": PATH, "callback": require_datasets, "required": required}
    return click.option("--data", "dataset", help=text, **how)


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


def html_option(text: str) -> Decorator[Any]:
    """Return `--html`, the path of a page that a browser opens."""
    return click.option("--html", type=PATH, callback=_require_page, help=text)


def rerun_option(text: str) -> Decorator[Any]:
    """Return `--rerun`, the path of a recording that the Rerun viewer opens."""
    how: Any = {"type": PATH, "callback": _require_recording, "metavar": "FILE.rrd"}
    return click.option("--rerun", help=text, **how)


def number_option(name: str, text: str, *, default: int, least: int = 1) -> Decorator[Any]:
    """Return an option that is an integer of `least` or more."""
    kind = click.IntRange(min=least)
    return click.option(name, type=kind, default=default, show_default=True, help=text)


def seed_option(text: str = "Random seed.") -> Decorator[Any]:
    """Return `--seed`."""
    return number_option("--seed", text, default=0, least=0)


def resamples_option(default: int) -> Decorator[Any]:
    """Return `--resamples`, the number of bootstrap resamples."""
    text = "Bootstrap resamples of the buildings; 0: no intervals."
    return number_option("--resamples", text, default=default, least=0)


def choice_option(name: str, names: list[str], text: str, *, default: str) -> Decorator[Any]:
    """Return an option that is one of a few names."""
    kind = click.Choice(names)
    return click.option(name, type=kind, default=default, show_default=True, help=text)


def split_option(text: str, *, default: str, more: tuple[str, ...] = ()) -> Decorator[Any]:
    """Return `--split`, which selects the buildings."""
    return choice_option("--split", ["train", "val", "test", *more], text, default=default)


def mask_options(how: str, how_much: str, *, min_open: bool = False) -> Decorator[Any]:
    """Return `--mask`, `--fraction`, `--withhold` and `--parts`, which say how to hide objects."""
    options = (
        click.option(
            "--mask", type=RegistryChoice(MASKS), default="uniform", show_default=True, help=how
        ),
        click.option(
            "--fraction",
            type=click.FloatRange(0, 1, min_open=min_open),
            default=0.5,
            show_default=True,
            help=how_much,
        ),
        click.option(
            "--withhold",
            type=click.FloatRange(0, 1),
            default=0.0,
            show_default=True,
            help="Share of the classes to hide everywhere except in searched rooms.",
        ),
        click.option(
            "--parts",
            is_flag=True,
            help="Hide the parts of hidden objects: the curtain rod of a hidden curtain.",
        ),
    )

    def decorate(function: Function) -> Function:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def split_names(text: str | None, *, option: str) -> tuple[str, ...] | None:
    """Return the unique names of a list with commas; None if the option is not given."""
    if text is None:
        return None
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise click.UsageError(f"{option} names nothing; expected names with commas between them")
    return names
