"""`bsg-data build`: build a dataset of scene graphs from a source."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.choices import complete_names_or_files
from bsg_cli.data.totals import format_losses, format_totals
from bsg_cli.options import (
    PATH,
    force_option,
    json_option,
    out_option,
    source_map_option,
    workers_option,
)
from bsg_cli.terminal import (
    Command,
    Workers,
    print_json,
    print_note,
    print_text,
    progress_bar,
    worker_pool,
)
from bsg_data import extend
from bsg_data.errors import BSGError
from bsg_data.sources.catalogue import SOURCES, parse_options


class _PartNumber(click.ParamType[tuple[int, int]]):
    """The number of a part of a build, `I/N`."""

    name = "part"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Return both numbers, or refuse them."""
        found = re.fullmatch(r"(\d+)/(\d+)", str(value), re.ASCII)
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            self.fail(f"{value!r}: expected I/N with I from 1 to N, such as 3/10", param, ctx)
        return int(found[1]), int(found[2])


@click.command("build", cls=Command)
@click.option("--hm3d", type=PATH, help="Any folder above HM3D's annotations.")
@click.option("--hm3d-stats", type=PATH, help="The public file HM3DSem-*.zip.")
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
    help="Option of the source, such as as_listed=yes for behavior; may be repeated.",
)
@click.option(
    "--meshes/--no-meshes",
    default=True,
    show_default=True,
    help="Read the mesh <hash>.semantic.glb beside each annotation.",
)
@click.option(
    "--snap-colours",
    type=click.IntRange(0, 255),
    help="Read JPEG textures: give each texel the nearest listed colour within N per channel, "
    "such as 8.",
)
@click.option(
    "--room-layouts",
    type=PATH,
    help="Folder of DomestiGraph YAML: labels, boxes and connections of rooms.",
)
@out_option("Dataset to write.", required=True)
@source_map_option
@workers_option
@click.option(
    "--parts",
    "part",
    type=_PartNumber(),
    metavar="I/N",
    help="Build only part I of N, in any order, on any machine that sees --out; run "
    "`bsg-data finalise` at the end.",
)
@click.option(
    "--strict",
    is_flag=True,
    help="Fail on malformed scenes, meshes and layouts, and on unmapped names.",
)
@force_option
@json_option
def command(
    hm3d: Path | None,
    hm3d_stats: Path | None,
    named: tuple[str, Path] | None,
    words: tuple[str, ...],
    meshes: bool,
    snap_colours: int | None,
    room_layouts: Path | None,
    out: Path,
    class_map: str | None,
    workers: Workers,
    part: tuple[int, int] | None,
    strict: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Build a dataset of scene graphs from one source.

    After an interruption, run the same command again to continue.

    \b
    Example:
      bsg-data build --hm3d buildings --out dataset
      bsg-data build --hm3d buildings --out dataset --parts 3/10
      bsg-data build --hm3d buildings --no-meshes --room-layouts layouts --out dataset
    """
    name, path = _choose_source(hm3d, hm3d_stats, named)
    own = _split_words(words)
    if snap_colours is not None and not meshes:
        raise click.UsageError(
            "--snap-colours needs meshes and --no-meshes leaves them out; give one of them"
        )
    if name == "hm3d-stats" and (snap_colours is not None or not meshes):
        raise click.UsageError(
            "--hm3d-stats has no meshes: --snap-colours and --no-meshes need --hm3d"
        )
    options = parse_options(name, own)
    if not meshes:
        options["meshes"] = False
    if snap_colours is not None:
        options["snap_colours"] = snap_colours
    reads = [path, *([] if room_layouts is None else [room_layouts])]
    if workers.scheduler is not None:
        reads = [place.absolute() for place in reads]  # workers run in other folders
    source = bsg_data.open_source(name, reads[0], **options)
    if room_layouts is not None:
        source = extend.WithLayouts(source, reads[1])
    pool = worker_pool(workers, reads=reads, writes=[out])
    left = 0  # shards that this command saw done before it was stopped
    try:
        with pool as executor, progress_bar("build", unit="shard") as report:

            def note(done: int, total: int) -> None:
                nonlocal left
                left = done if done < total else 0
                report(done, total)

            how: dict[str, Any] = {"class_map": class_map, "strict": strict, "force": force}
            how |= {"executor": executor, "progress": note}
            if part is not None:
                built = extend.build_part(source, out, extend.Part(*part), **how)
                _tell_part(built, part, out, as_json=as_json)
                return
            manifest = bsg_data.build_dataset(source, out, **how)
    except (BSGError, KeyboardInterrupt):
        if left:
            print_note(
                f"finished shards are in {out}.partial; run the same command again to continue"
            )
        raise
    if as_json:
        print_json(manifest.model_dump(mode="json", exclude={"files"}))
        return
    print_text(format_totals(manifest))
    print_text(format_losses(manifest))
    print_text(f"dataset in {out}")


def _tell_part(built: extend.BuiltPart, part: tuple[int, int], out: Path, *, as_json: bool) -> None:
    """Print what a part built and how many shards are still missing."""
    number, of = part
    if as_json:
        print_json({"part": number, "of": of, **asdict(built)})
        return
    shards, left = len(built.shards), len(built.missing)
    made = f"{shards:,} shard{'s' * (shards != 1)}, {built.scenes:,} scenes"
    print_text(f"part {number} of {of}: {made}")
    missing = f"{left:,} shard{'s are' if left > 1 else ' is'} still missing"
    then = missing if left else "all shards are built"
    print_text(f"{then}; after the last part run: bsg-data finalise {out}")


def _choose_source(
    hm3d: Path | None, hm3d_stats: Path | None, named: tuple[str, Path] | None
) -> tuple[str, Path]:
    """Return name and path of the source; `--hm3d PATH` means `--source hm3d PATH`."""
    given = [("hm3d", hm3d), ("hm3d-stats", hm3d_stats), *([named] if named else [])]
    sources = [(name, path) for name, path in given if path is not None]
    if len(sources) != 1:
        raise click.UsageError(
            f"expected one source, found {len(sources)}; give one source: --hm3d PATH, "
            "--hm3d-stats ZIP or --source NAME PATH"
        )
    return sources[0]


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
