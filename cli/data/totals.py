"""Format the totals of a dataset, and what its build left out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from bsg_data import extend
from bsg_data.tables import format_text


def format_totals(manifest: extend.Manifest) -> str:
    """Return the totals of a dataset as one line."""
    t = manifest.totals
    placed = (
        f"; {t.placed:,} with geometry, {t.adjacent:,} pairs of adjacent rooms" if t.placed else ""
    )
    return (
        f"{t.scenes:,} scenes, {t.rooms:,} rooms, {t.objects:,} objects, "
        f"{t.classified:,} in {len(manifest.class_space.classes)} classes of "
        f"{manifest.class_space.name}{_name_maps(manifest)}{placed}"
    )


def _name_maps(manifest: extend.Manifest) -> str:
    """Name the class maps other than the one named like the class space."""
    names = {source.class_map.version for source in manifest.sources}
    others = sorted(names - {manifest.class_space.name})
    return f" by the class map {', '.join(others)}" if others else ""


def format_hashes(hashes: Mapping[str, str]) -> str:
    """Return a table with the sha256 of the masks of each split and of all splits."""
    return format_text(list(hashes.items()), header=("masks of", "sha256"))


def format_sources(dataset: Path) -> str:
    """Return a table of what each source adds to a dataset.

    The share divides the objects with a class by all objects that are not building structure.
    """
    rows = [
        (
            row["source"],
            *(f"{row[name]:,}" for name in ("buildings", "rooms", "objects", "classified")),
            row["classes"],
            f"{row['share']:.1%}",
            f"{row['unmapped']:,}",
            f"{row['placed']:,}",
            f"{row['connections']:,}",
        )
        for row in extend.count_sources(dataset).to_dict(orient="records")
    ]
    header = (
        *("source", "buildings", "rooms", "objects", "with a class", "classes", "of non-structure"),
        *("unmapped", "with places", "adjacent rooms"),
    )
    return format_text(rows, header=header)


def format_losses(manifest: extend.Manifest, *, most: int = 20) -> str:
    """Return tables of skipped scenes, left-out geometry, unmapped names and resolved names."""
    left = manifest.left_out
    lines = [
        f"skipped scenes: {len(manifest.skipped):,}, unmapped objects: {manifest.totals.unmapped:,}"
    ]
    if manifest.meshes:
        lines.append(_mesh_line(list(manifest.meshes.values())))
        bare = manifest.totals.scenes - len({*manifest.meshes, *(s.scene_id for s in left)})
        if bare > 0:
            lines.append(f"scenes without a mesh beside their annotation: {bare:,}")
    for entries, what in ((manifest.skipped, "skipped scene"), (left, "left out")):
        if entries:
            rows = [(entry.scene_id, entry.location, entry.reason) for entry in entries[:most]]
            lines.append(format_text(rows, header=(what, "location", "reason")))
    if manifest.unmapped:
        names = [(u.name, u.instances, ", ".join(u.nearest)) for u in manifest.unmapped[:most]]
        lines.append(format_text(names, header=("unmapped name", "instances", "nearest")))
    if manifest.resolved:
        known = [
            (r.name, r.instances, r.rule, r.category, r.class_name or "none")
            for r in manifest.resolved[:most]
        ]
        header = ("name resolved by rule", "instances", "rule", "category", "class")
        lines.append(format_text(known, header=header))
    counts = (len(manifest.skipped), len(left), len(manifest.unmapped), len(manifest.resolved))
    if max(counts) > most:
        lines.append("… dataset.json has the full lists")
    return "\n".join(lines)


def _mesh_line(meshes: list[extend.MeshCoverage]) -> str:
    texels, area = sum(m.texels for m in meshes), sum(m.area for m in meshes)
    names = {
        "listed": "listed",
        "snapped": "snapped",
        "black": "black (background)",
        "unlisted": "unlisted",
    }
    shares = ", ".join(
        f"{sum(getattr(m, name) for m in meshes) / max(texels, 1):.1%} {shown}"
        for name, shown in names.items()
        if name != "snapped" or any(m.snapped for m in meshes)
    )
    pixels = f"of {texels:,} texels {shares}; " if texels else ""
    listed = sum(m.listed_area for m in meshes) / max(area, 1e-9)
    missing = sum(m.without_geometry for m in meshes)
    return (
        f"meshes: {len(meshes):,}; {pixels}{listed:.1%} of {area:,.0f} m² is of listed objects; "
        f"listed objects without a surface: {missing:,}"
    )
