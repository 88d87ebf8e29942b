"""Report a missing dataset before any other error of a command line."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_data.spelling import nearest_names

_GIVEN = (str, tuple, bool)  # click marks a missing value by an object of another type


class DatasetPath(click.Path):
    """The path of a dataset that a command reads."""

    def __init__(self) -> None:
        super().__init__(file_okay=False, path_type=Path)


def require_datasets(command: click.Command, ctx: click.Context, args: Sequence[str]) -> None:
    """Refuse a missing dataset before other options are checked and slow modules imported.

    Nothing is refused when the user asks for help or the version, or when a shell completes.

    Raises:
        DatasetError: for the first dataset that is missing or damaged.
    """
    params = command.get_params(ctx)
    names = [param.name for param in params if isinstance(param.type, DatasetPath)]
    if not names or ctx.resilient_parsing:
        return
    values = _parse_anyhow(command, ctx, args)
    if any(values.get(param.name) is True for param in params if param.is_eager):
        return
    for value in map(values.get, names):
        for path in (value,) if isinstance(value, str) else value or ():
            bsg_data.read_manifest(Path(path))


def _parse_anyhow(
    command: click.Command, ctx: click.Context, args: Sequence[str]
) -> Mapping[str | None, Any]:
    """Return parameter → its value on a command line, before any value is checked.

    An unknown option is read as the nearest known one. It is skipped if no known option is near.
    An option without its value is skipped too.
    """
    words = list(args)
    options = [name for param in command.get_params(ctx) for name in param.opts]
    for _ in args:
        try:
            values, _, _ = command.make_parser(ctx).parse_args([*words])
        except click.NoSuchOption as error:
            wrong, meant = error.option_name, nearest_names(error.option_name, options, most=1)
        except click.BadOptionUsage as error:
            wrong, meant = error.option_name, ()
        except click.UsageError:
            break
        else:
            return {n: value for n, value in values.items() if isinstance(value, _GIVEN)}
        place = _place_of(wrong, words)
        words[place : place + 1] = [words[place].replace(wrong, one, 1) for one in meant]
    return {}


def _place_of(option: str, words: Sequence[str]) -> int:
    """Return the index of the word with an option: `--name`, `--name=value`, or `-n` in `-mn`."""
    if option.startswith("--"):
        return next(n for n, word in enumerate(words) if word.partition("=")[0] == option)
    return next(n for n, word in enumerate(words) if re.match(r"-[^-]", word) and option[1] in word)
