"""Format the totals of a dataset, and what its build left out or did not understand."""

from __future__ import annotations

from collections.abc import Mapping
from operator import attrgetter
from typing import Any

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
    left = manifest.left_out
    lines = [
        f"skipped scenes: {len(manifest.skipped):,}, unmapped objects: {manifest.totals.unmapped:,}"
    ]
    if manifest.meshes:
        lines.append(_mesh_line(list(manifest.meshes.values())))
        bare = manifest.totals.scenes - len({*manifest.meshes, *(s.scene_id for s in left)})
        if bare > 0:
            lines.append(f"scenes without a mesh beside their annotation: {bare:,}")
    notes = [entry for entry in left if entry.scene_id == "all"]  # of the source as a whole
    lines += [f"note: {entry.location}: {entry.reason}" for entry in notes[:_SHOWN]]
    left = tuple(entry for entry in left if entry.scene_id != "all")
    for entries, what in ((manifest.skipped, "skipped scene"), (left, "left out")):
        if entries:
            rows = [(entry.scene_id, entry.location, entry.reason) for entry in entries[:_SHOWN]]
            lines.append(format_text(rows, header=(what, "location", "reason")))
    if manifest.unmapped:
        names = [
            (_cut(u.name), u.instances, ", ".join(map(_cut, u.nearest)))
            for u in manifest.unmapped[:_SHOWN]
        ]
        lines.append(format_text(names, header=("unmapped name", "instances", "nearest")))
    if manifest.unknown_labels:
        rooms = [(_cut(one.name), f"{one.instances:,}") for one in manifest.unknown_labels[:_SHOWN]]
        lines.append(format_text(rooms, header=("kind of room not known", "rooms")))
        lines.append("name them with --room-labels FILE (source_label,label)")
    if manifest.resolved:
        known = [
            (_cut(r.name), r.instances, r.rule, _cut(r.category), r.class_name or "none")
            for r in manifest.resolved[:_SHOWN]
        ]
        header = ("name resolved by rule", "instances", "rule", "category", "class")
        lines.append(format_text(known, header=header))
    told = (manifest.skipped, left, manifest.unmapped, manifest.unknown_labels, manifest.resolved)
    if max(map(len, told)) > _SHOWN:
        lines.append("… dataset.json has the full lists")
    return "\n".join(lines)


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"


def _mesh_line(meshes: list[extend.MeshCoverage]) -> str:
    def total(name: str) -> Any:
        return sum(map(attrgetter(name), meshes))

    texels, snapped = total("texels"), ["snapped"] if total("snapped") else []
    shown = ("listed", *snapped, "black", "unlisted")
    fractions = ", ".join(f"{total(name) / max(texels, 1):.1%} {name}" for name in shown)
    fractions = fractions.replace(" black", " black (background)")
    pixels = f"of {texels:,} texels {fractions}; " if texels else ""
    listed = total("listed_area") / max(total("area"), 1e-9)
    return (
        f"meshes: {len(meshes):,}; {pixels}{listed:.1%} of {total('area'):,.0f} m² is of listed "
        f"objects; listed objects without a surface: {total('without_geometry'):,}"
    )
