"""`bsg-data map`: list, show and compare class maps."""

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
    """List, show, measure and compare class maps.

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
    found = [(one, one.classify(category).class_index) for one in maps]
    return {one.version: one.classes[index] for one, index in found if index is not None}


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
    shell_complete=complete_class_map,
    help="Use this map instead of the dataset's own: a version, or your NAME.csv.",
)
@json_option
def _map_coverage(dataset: Path, class_map: str | None, as_json: bool) -> None:
    """Measure how much of a dataset a class map covers.

    \b
    Example:
      bsg-data map coverage dataset
    """
    loaded = None if class_map is None else bsg_data.load_class_map(class_map)
    coverage = extend.measure_coverage(dataset, loaded)
    if as_json:
        print_json(coverage)
        return
    left_out = coverage.pop("most_left_out")
    names = bsg_data.read_manifest(dataset).class_map_names if loaded is None else loaded.version
    rows = [(what, _show(value)) for what, value in coverage.items()]
    print_text(format_text(rows, header=("", names)))
    if left_out:
        most = [(name, f"{count:,}") for name, count in left_out.items()]
        header = ("most frequent left out", "instances")
        print_text("\n" + format_text(most, header=header))


@class_maps.command("compare")
@dataset_argument
@click.option(
    "--class-map",
    "class_maps",
    multiple=True,
    required=True,
    shell_complete=complete_class_map,
    help="A published version, or your NAME.csv; repeat it for each map.",
)
@json_option
def _map_compare(dataset: Path, class_maps: tuple[str, ...], as_json: bool) -> None:
    """Compare class maps on the objects of a dataset.

    The output has the coverage of each map. For each class it has the instances, the rooms with at
    least one, and the rooms with two or more.

    \b
    Example:
      bsg-data map compare dataset --class-map hm3d45-v1 --class-map hm3d45-v2
    """
    maps = [bsg_data.load_class_map(name) for name in dict.fromkeys(class_maps)]
    built = {source.class_map.version for source in bsg_data.read_manifest(dataset).sources}
    if len(built) > 1:
        print_note(
            f"each map looks up all objects, although the dataset was built with several maps "
            f"({', '.join(sorted(built))}); `bsg-data map coverage` counts it as built"
        )
    coverages, frames = {}, {}
    for one in maps:
        coverages[one.version] = extend.measure_coverage(dataset, one)
        del coverages[one.version]["most_left_out"]
        frames[one.version] = {row.pop("class"): row for row in extend.count_classes(dataset, one)}
    if as_json:
        print_json(
            {
                name: {"coverage": coverage, "classes": frames[name]}
                for name, coverage in coverages.items()
            }
        )
        return
    first = next(iter(coverages.values()))
    rows = [(what, *(_show(one[what]) for one in coverages.values())) for what in first]
    print_text(format_text(rows, header=("", *coverages)))
    header = (
        *("class", *(f"instances {name}" for name in frames)),
        *(f"{what} {name}" for what in ("rooms", "two or more") for name in frames),
    )
    columns = [
        {name: row[column] for name, row in frame.items()}
        for column in ("instances", "rooms", "doubles")
        for frame in frames.values()
    ]
    cells = [
        (name, *(f"{column[name]:,}" if name in column else "-" for column in columns))
        for name in sorted({name for frame in frames.values() for name in frame})
    ]
    print_text("\n" + format_text(cells, header=header))


def _show(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:.1%}"
