"""`bsg-data map`: list and show class maps, and measure what they cover."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.choices import complete_class_map
from bsg_cli.options import class_map_option, dataset_argument, json_option
from bsg_cli.terminal import CommandGroup, print_json, print_note, print_text
from bsg_data import extend
from bsg_data.tables import format_text

# why a known name has no class, by its role
_WITHOUT_CLASS = {
    "structure": " (part of the building)",
    "left-out": " (known, but not counted)",
}


@click.group("map", cls=CommandGroup)
def class_maps() -> None:
    """List and show class maps, and measure what they cover.

    \b
    Example:
      bsg-data map show "trash can"
    """


@class_maps.command("list")
def _map_list() -> None:
    """List the published class maps.

    \b
    Example:
      bsg-data map list
    """
    rows = extend.published_maps().values()
    maps = [(row, bsg_data.load_class_map(row.class_map)) for row in rows]
    cells = [
        (row.class_map, row.class_space, len(m.classes), row.source, len(m.entries), m.sha256[:12])
        for row, m in maps
    ]
    header = ("class map", "class space", "classes", "words of", "spellings", "sha256")
    print_text(format_text(cells, header=header))


def _find_elsewhere(category: str) -> dict[str, str]:
    """Return map → class of a name, for the published maps that have a class for it."""
    maps = [bsg_data.load_class_map(version) for version in extend.published_maps()]
    found = [(class_map, class_map.classify(category).class_index) for class_map in maps]
    return {
        class_map.version: class_map.classes[index]
        for class_map, index in found
        if index is not None
    }


def _describe(answer: Mapping[str, Any], version: str, index: int | None) -> Iterator[str]:
    """Yield what `map show` says of a name, line by line; `index` is of the class of that name."""
    name = answer["name"]
    if answer["mapped"]:
        rule = f" (by the rule {answer['rule']!r})" if answer["rule"] else ""
        what = answer["class"] or f"none{_WITHOUT_CLASS.get(answer['role'], '')}"
        yield f"name {name!r} → corrected {answer['category']!r}{rule} → class {what}"
    elif index is None:
        near = ", ".join(answer["nearest"]) or "nothing like it"
        yield f"{name!r} is not in {version}; nearest: {near}"
    for other, found in answer["elsewhere"].items():
        yield f"in {other}: class {found}"
    if index is not None:
        yield f"class {index}, {name}: {answer['definition']}"
        spellings = answer["spellings"]
        yield f"{len(spellings)} spellings: {', '.join(map(repr, spellings))}"


@class_maps.command("show")
@click.argument("category")
@class_map_option
@json_option
def _map_show(category: str, class_map: str, as_json: bool) -> None:
    """Show the class of a category, or all spellings of a class.

    \b
    Example:
      bsg-data map show "trash can"
    """
    loaded = bsg_data.load_class_map(class_map)
    known = loaded.classify(category)
    name = None if known.class_index is None else loaded.classes[known.class_index]
    index = loaded.classes.index(category) if category in loaded.classes else None
    spellings = sorted(raw for raw, e in loaded.entries.items() if e.class_index == index)
    mapped = known.role != "unmapped"
    answer: dict[str, Any] = {
        "name": category,
        "mapped": mapped,
        "category": known.category,
        "class": name,
        "role": known.role,
        "rule": known.rule,
        "nearest": [] if mapped else list(loaded.nearest(category)),
        "elsewhere": {} if name or index is not None else _find_elsewhere(category),
        "definition": None if index is None else loaded.definitions[index],
        "spellings": [] if index is None else spellings,
    }
    if as_json:
        print_json(answer)
    else:
        print_text("\n".join(_describe(answer, loaded.version, index)))
    if not mapped and index is None:
        raise click.exceptions.Exit(1)


@class_maps.command("coverage")
@dataset_argument
@click.option(
    "--class-map",
    "names",
    multiple=True,
    shell_complete=complete_class_map,
    help="Look up all objects in this map instead: a version, or your NAME.csv. Repeat it to "
    "compare maps.",
)
@json_option
def _map_coverage(dataset: Path, names: tuple[str, ...], as_json: bool) -> None:
    """Measure how much of a dataset class maps cover.

    Without --class-map, these are the maps that the dataset was built with.

    \b
    Example:
      bsg-data map coverage dataset
      bsg-data map coverage dataset --class-map hm3d45-v1 --class-map hm3d-wide-v1
    """
    data = bsg_data.Dataset.open(dataset)
    manifest = data.manifest
    if names and len({source.class_map.version for source in manifest.sources}) > 1:
        print_note(
            "each map looks up all objects, although the dataset was built with several maps "
            f"({manifest.class_map_names}); without --class-map they are counted as built"
        )
    found = {
        # None: as built
        name: extend.measure_coverage(data, bsg_data.load_class_map(name) if names else None)
        for name in names or (manifest.class_map_names,)
    }
    if as_json:
        print_json(found)
    else:
        print_text("\n\n".join(_format_coverage(found)))


def _format_coverage(found: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield the tables of `map coverage`: numbers, and names left out."""
    columns = list(found.values())
    numbers = [name for name, value in columns[0].items() if not isinstance(value, dict)]
    shares = [name for name in numbers if name.startswith("share")]
    rows = [
        (n, *(f"{column[n]:.1%}" if n in shares else column[n] for column in columns))
        for n in numbers
    ]
    yield format_text(rows, header=("", *found), numeric=tuple(found))
    for name, column in found.items():
        if names := list(column["most_left_out"].items()):
            yield format_text(names, header=(f"most left out by {name}", "instances"))
