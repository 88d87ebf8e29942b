"""`bsg-data map`: what class maps make of names."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.options import class_map_option, dataset_argument, json_option
from bsg_cli.terminal import CommandGroup, print_json
from bsg_data.tables import format_text


@click.group("map", cls=CommandGroup)
def command() -> None:
    """Look into class maps.

    \b
    Example:
      bsg-data map show "trash can"
    """


@command.command("list")
@json_option
def map_list(as_json: bool) -> None:
    """List the published class maps.

    \b
    Example:
      bsg-data map list
    """
    maps = [bsg_data.load_class_map(version) for version in bsg_data.list_class_maps()]
    if as_json:
        fields = [{"version": m.version, "sha256": m.sha256, "classes": m.classes} for m in maps]
        print_json(fields)
        return
    rows = [(m.version, len(m.classes), len(m.entries), m.sha256) for m in maps]
    click.echo(format_text(rows, header=("version", "classes", "spellings", "sha256")))


@command.command("show")
@click.argument("category")
@class_map_option
@json_option
def map_show(category: str, class_map: str, as_json: bool) -> None:
    """Show what a category, or every spelling of a class, is mapped to.

    \b
    Example:
      bsg-data map show "trash can"
    """
    loaded = bsg_data.load_class_map(class_map)
    entry = loaded.lookup(category)
    name = None if entry is None or entry.class_index is None else loaded.classes[entry.class_index]
    index = loaded.classes.index(category) if category in loaded.classes else None
    spellings = sorted(raw for raw, e in loaded.entries.items() if e.class_index == index)
    answer = {
        "name": category,
        "mapped": entry is not None,
        "category": entry.category if entry else None,
        "class": name,
        "nearest": [] if entry else list(loaded.nearest(category)),
        "definition": None if index is None else loaded.space.definitions[index],
        "spellings": [] if index is None else spellings,
    }
    known = entry is not None or index is not None
    if as_json:
        print_json(answer)
    elif entry is not None:
        structure = " (part of the building)" if entry.category in loaded.structure else ""
        click.echo(
            f"name {category!r} → corrected {entry.category!r} → class {name or f'none{structure}'}"
        )
    elif not known:
        near = ", ".join(loaded.nearest(category)) or "nothing like it"
        click.echo(f"{category!r} is not in {loaded.version}; nearest: {near}")
    if index is not None and not as_json:
        click.echo(f"class {index}, {category}: {loaded.space.definitions[index]}")
        click.echo(f"{len(spellings)} spellings: {', '.join(map(repr, spellings))}")
    if not known:
        raise click.exceptions.Exit(1)


@command.command("coverage")
@dataset_argument
@click.option(
    "--class-map", help="Another map than the dataset's own: a version, or your NAME.csv."
)
@json_option
def map_coverage(dataset: Path, class_map: str | None, as_json: bool) -> None:
    """Measure how much of a dataset a class map covers.

    \b
    Example:
      bsg-data map coverage dataset
    """
    manifest = bsg_data.read_manifest(dataset)
    loaded = bsg_data.load_class_map(class_map or manifest.sources[0].class_map.version)
    coverage = bsg_data.measure_coverage(dataset, loaded)
    parts = ("objects", "classified", "structure", "nameless", "unmapped", "left_out")
    counts = {part: int(getattr(coverage, part)) for part in parts}
    if as_json:
        shares = {"share": coverage.share, "share_of_named": coverage.share_of_named}
        print_json({**counts, **shares, "most_left_out": dict(coverage.most_left_out)})
        return
    rows = [(part.replace("_", " "), count) for part, count in counts.items()]
    click.echo(format_text(rows, header=(loaded.version, "instances")))
    click.echo(f"\nclassified, of what is not structure: {coverage.share:.1%}")
    click.echo(
        f"classified, of what is not structure and has a name: {coverage.share_of_named:.1%}"
    )
    rows = list(coverage.most_left_out)
    if rows:
        click.echo("\n" + format_text(rows, header=("most frequent left out", "instances")))
