"""The options that several commands share."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

import bsg_data
from bsg_cli.choices import complete_class_map, complete_model
from bsg_data.observation.masks import MASKS
from bsg_data.registry import Registry
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP
from bsg_models.belief.clock import read_now

Function = TypeVar("Function", bound=Callable[..., Any])
_Decorator = Callable[[Function], Function]
PATH = click.Path(path_type=Path)
_MOST_WORKERS = 1024  # each is a process; one machine has no use for more


class RegistryChoice(click.Choice[str]):
    """One name of a registry; it takes long to list what is installed, so who needs it asks."""

    case_sensitive = True

    def __init__(self, registry: Registry[Any]) -> None:
        self._registry = registry

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        """All names."""
        return self._registry.names()

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name; an unknown one is refused with the nearest, and all known names."""
        self._registry.require([value])
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
room_labels_option = click.option(
    "--room-labels",
    type=PATH,
    help="CSV source_label,label: what words for rooms mean that we do not know.",
)


workers_option = click.option(
    "--workers",
    type=click.IntRange(1, _MOST_WORKERS),
    default=lambda: os.cpu_count() or 1,
    show_default="all cores",
    help="Number of processes. The result does not depend on it.",
)


def read_now_option(_: click.Context, __: click.Parameter, text: str | None) -> float | None:
    """Return the time that an option says, in seconds."""
    try:
        return None if text is None else read_now(text)
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


def model_option(text: str, *, multiple: bool = False) -> _Decorator[Any]:
    """Return `--model`: a shipped model, a run, or a model of the hub."""
    return click.option(
        "--model",
        metavar="NAME|RUN|FILE",
        multiple=multiple,
        help=text,
        shell_complete=complete_model,
    )


def out_option(text: str, *, required: bool = False) -> _Decorator[Any]:
    """Return `--out`, the path of the result."""
    return click.option("--out", type=PATH, required=required, help=text)


def html_option(text: str) -> _Decorator[Any]:
    """Return `--html`, the path of a page that a browser opens."""
    return click.option("--html", type=PATH, callback=_require_page, help=text)


def number_option(name: str, text: str, *, default: int, least: int = 1) -> _Decorator[Any]:
    """Return an option that is an integer of `least` or more."""
    kind = click.IntRange(min=least)
    return click.option(name, type=kind, default=default, show_default=True, help=text)


seed_option = number_option("--seed", "Random seed.", default=0, least=0)


def choice_option(name: str, names: list[str], text: str, *, default: str) -> _Decorator[Any]:
    """Return an option that is one of a few names."""
    kind = click.Choice(names)
    return click.option(name, type=kind, default=default, show_default=True, help=text)


def split_option(text: str, *, default: str, more: tuple[str, ...] = ()) -> _Decorator[Any]:
    """Return `--split`, which selects the buildings."""
    return choice_option("--split", ["train", "val", "test", *more], text, default=default)


def mask_options(how: str, how_much: str, *, min_open: bool = False) -> _Decorator[Any]:
    """Return `--mask` and `--fraction`, which say how to hide objects."""
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


def refuse_unused(names: Sequence[str], what: str) -> None:
    """Refuse options on the command line that would change nothing."""
    context = click.get_current_context()
    for option in context.command.params:
        source = context.get_parameter_source(str(option.name))
        if option.name in names and source is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"{what} does not use {option.opts[0]}; leave one of them out")
