"""`bsg-data build` and `merge`: make a dataset of a source, or of datasets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.choices import complete_class_map, complete_names_or_files
from bsg_cli.data.totals import format_losses, format_sources, format_totals, warn_of_recordings
from bsg_cli.options import (
    PATH,
    force_option,
    out_option,
    require_datasets,
    room_labels_option,
    workers_option,
)
from bsg_cli.terminal import (
    Command,
    print_note,
    print_text,
    progress_bar,
    worker_pool,
)
from bsg_data import extend
from bsg_data.errors import BSGError
from bsg_data.sources.catalogue import SOURCES, parse_options


@click.command("build", cls=Command)
@click.option("--hm3d", type=PATH, help="Any folder above HM3D's annotations.")
@click.option(
    "--source",
    "named",
    type=(str, PATH),
    metavar="NAME PATH",
    shell_complete=complete_names_or_files(lambda: SOURCES),
    help=f"Any source by name: {', '.join(SOURCES)}.",
)
@click.option(
    "--option",
    "words",
    multiple=True,
    metavar="NAME=VALUE",
    help="Option of the source, such as as_listed=yes; may be repeated (docs/sources.md).",
)
@click.option(
    "--meshes/--no-meshes",
    default=True,
    show_default=True,
    help="Read the mesh <hash>.semantic.glb beside each annotation.",
)
@click.option(
    "--room-layouts",
    type=PATH,
    help="Labels, boxes and connections of rooms: DomestiGraph's YAML or habitat's JSON, a folder "
    "or a file, or a table scene,region,label.",
)
@room_labels_option
@out_option("Dataset to write.", required=True)
@click.option(
    "--class-map",
    help="A published version, or the path of your own NAME.csv.  [default: the source's]",
    shell_complete=complete_class_map,
)
@workers_option
@click.option(
    "--strict",
    is_flag=True,
    help="Fail on malformed scenes, meshes and layouts, and on unmapped names.",
)
@force_option
def build(
    out: Path,
    workers: int,
    room_layouts: Path | None,
    room_labels: Path | None,
    class_map: str | None,
    strict: bool,
    force: bool,
    **chosen: Any,
) -> None:
    """Build a dataset of scene graphs from one source.

    After an interruption, run the same command again to continue.

    \b
    Example:
      bsg-data build --hm3d buildings --out dataset
      bsg-data build --hm3d buildings --no-meshes --room-layouts layouts --out dataset
    """
    name, path, options = _choose_source(**chosen)
    source = bsg_data.open_source(name, path, **options)
    if room_layouts is not None:
        source = extend.WithLayouts(source, room_layouts)
    if room_labels is not None:
        source = extend.WithRoomLabels(source, room_labels)
    try:
        with worker_pool(workers) as executor, progress_bar("build", unit="shard") as report:
            how: dict[str, Any] = {"class_map": class_map, "strict": strict, "force": force}
            how |= {"executor": executor, "progress": report}
            manifest = bsg_data.build_dataset(source, out, **how)
    except (BSGError, KeyboardInterrupt):
        if any(Path(f"{out}.partial").glob(".build/part-*")):
            print_note(
                f"finished shards are in {out}.partial; run the same command again to continue"
            )
        raise
    _print_built(manifest, format_losses(manifest), out)


def _print_built(manifest: extend.Manifest, more: str, out: Path) -> None:
    warn_of_recordings(manifest)
    print_text(f"{format_totals(manifest)}\n{more}\ndataset in {out}; next: bsg-data split {out}")


def _choose_source(
    hm3d: Path | None,
    named: tuple[str, Path] | None,
    words: tuple[str, ...],
    meshes: bool,
) -> tuple[str, Path, dict[str, Any]]:
    """Return name, path and options of the source; `--hm3d PATH` means `--source hm3d PATH`."""
    sources = [*([("hm3d", hm3d)] if hm3d else []), *([named] if named else [])]
    if len(sources) != 1:
        raise click.UsageError(
            f"expected one source, found {len(sources)}; give --hm3d PATH or --source NAME PATH"
        )
    name, path = sources[0]
    own = _split_words(words)
    return name, path, parse_options(name, own if meshes else {**own, "meshes": "no"})


def _split_words(words: tuple[str, ...]) -> dict[str, str]:
    """Return name → value of words `NAME=VALUE` with unique names."""
    options: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.strip().replace("-", "_")
        if not equals or not name:
            raise click.UsageError(f"--option {word!r}: expected NAME=VALUE")
        if name in options:
            raise click.UsageError(f"--option {name} is there twice; give it once")
        options[name] = value
    return options


@click.command("merge", cls=Command)
@click.argument(
    "datasets",
    type=PATH,
    callback=require_datasets,
    nargs=-1,
    required=True,
    metavar="DATASET DATASET ...",
)
@out_option("Dataset to write.", required=True)
@force_option
def merge(datasets: tuple[Path, ...], out: Path, force: bool) -> None:
    """Merge datasets of one class space into one.

    Rows keep their source. Splits and pairs are not copied: make them again.

    \b
    Example:
      bsg-data merge hm3d behavior --out both
    """
    with progress_bar("merge", unit="scene") as report:
        manifest = bsg_data.merge_datasets(datasets, out, force=force, progress=report)
    _print_built(manifest, f"\n{format_sources(bsg_data.Dataset.open(out))}\n", out)
