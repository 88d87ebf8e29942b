"""Format the totals of a dataset, and what its build left out or did not understand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple

import bsg_data
from bsg_cli.terminal import print_note
from bsg_data import extend
from bsg_data.tables import format_text

_SHOWN = 20  # rows of each table
_LONGEST = 200  # characters of a name


def format_totals(manifest: extend.Manifest) -> str:
    """Return the totals of a dataset as one line."""
    t, space = manifest.totals, manifest.class_space
    others = sorted({entry.version for entry in manifest.class_maps} - {space.name})
    maps = f" by the class map {', '.join(others)}" if others else ""
    placed = (
        f"; {t.placed:,} with geometry, {t.adjacent:,} pairs of adjacent rooms" if t.placed else ""
    )
    labelled = f"; {t.labelled:,} rooms with a label" if t.labelled else ""
    return (
        f"{t.scenes:,} scenes, {t.rooms:,} rooms, {t.objects:,} objects, "
        f"{t.classified:,} in {len(space.classes)} classes of {space.name}{maps}{placed}{labelled}"
    )


def format_hashes(hashes: Mapping[str, str]) -> str:
    """Return a table with the sha256 of the masks of each split and of all splits."""
    return format_text(list(hashes.items()), header=("masks of", "sha256"))


def format_sources(data: bsg_data.Dataset) -> str:
    """Return a table of what each source adds to a dataset.

    The share divides the objects with a class by all objects that are not building structure.
    """
    shown = {
        "buildings": "buildings",
        "rooms": "rooms",
        "objects": "objects",
        "classified": "with a class",
        "classes": "classes",
        "share": "of non-structure",
        "unmapped": "unmapped",
        "placed": "with places",
        "connections": "adjacent rooms",
    }
    rows = [
        (row["source"], *(f"{row[name]:{'.1%' if name == 'share' else ','}}" for name in shown))
        for row in extend.count_sources(data)
    ]
    return format_text(rows, header=("source", *shown.values()), numeric=("classes",))


def warn_of_recordings(manifest: extend.Manifest) -> bool:
    """Say that buildings of a dataset are recordings, if any is; return whether."""
    recorded = sorted({source.kind for source in manifest.sources if not source.is_complete})
    if recorded:
        print_note(
            f"the buildings of {', '.join(recorded)} are what a robot saw: what it did not see "
            "counts as not there. Do not train on them, and do not measure models by them"
        )
    return bool(recorded)


def format_losses(manifest: extend.Manifest) -> str:
    """Return tables of what a build left out, did not understand, or resolved by rules."""
    lines = [
        f"skipped scenes: {len(manifest.skipped):,}, unmapped objects: {manifest.totals.unmapped:,}"
    ]
    if manifest.meshes:
        lines.append(_mesh_line(list(manifest.meshes.values())))
        named = {*manifest.meshes, *(skip.scene_id for skip in manifest.left_out)}
        if bare := max(manifest.totals.scenes - len(named), 0):
            lines.append(f"scenes without a mesh beside their annotation: {bare:,}")
    notes = [
        skip for skip in manifest.left_out if skip.scene_id == "all"
    ]  # of the source as a whole
    lines += [f"note: {skip.location}: {skip.reason}" for skip in notes[:_SHOWN]]
    left = [skip for skip in manifest.left_out if skip.scene_id != "all"]
    tables: dict[tuple[str, ...], list[tuple[object, ...]]] = {
        ("skipped scene", "location", "reason"): [*map(astuple, manifest.skipped)],
        ("left out", "location", "reason"): [*map(astuple, left)],
        ("unmapped name", "instances", "nearest"): [
            (_cut(entry.name), entry.instances, ", ".join(map(_cut, entry.nearest)))
            for entry in manifest.unmapped
        ],
        ("kind of room not known", "rooms"): [
            (_cut(entry.name), f"{entry.instances:,}") for entry in manifest.unknown_labels
        ],
        ("name resolved by rule", "instances", "rule", "category", "class"): [
            (
                _cut(entry.name),
                entry.instances,
                entry.rule,
                _cut(entry.category),
                entry.class_name or "none",
            )
            for entry in manifest.resolved
        ],
    }
    for header, rows in tables.items():
        lines += [format_text(rows[:_SHOWN], header=header)] if rows else []
        if rows and header[-1] == "rooms":
            lines.append("name them with --room-labels FILE (source_label,label)")
    if max(map(len, tables.values())) > _SHOWN:
        lines.append("… dataset.json has the full lists")
    return "\n".join(lines)


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _mesh_line(meshes: list[extend.MeshCoverage]) -> str:
    summed = [name for name in extend.MeshCoverage.model_fields if name != "sha256"]
    total = {name: sum(getattr(mesh, name) for mesh in meshes) for name in summed}
    shown = ("listed", *(["snapped"] if total["snapped"] else []), "black", "unlisted")
    fractions = ", ".join(f"{total[name] / max(total['texels'], 1):.1%} {name}" for name in shown)
    fractions = fractions.replace(" black", " black (background)")
    pixels = f"of {total['texels']:,} texels {fractions}; " if total["texels"] else ""
    listed = total["listed_area"] / max(total["area"], 1e-9)
    return (
        f"meshes: {len(meshes):,}; {pixels}{listed:.1%} of {total['area']:,.0f} m² is of listed "
        f"objects; listed objects without a surface: {total['without_geometry']:,}"
    )
