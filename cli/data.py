"""`bsg-data`: from annotations to shards, splits, pairs, and proof that they are sound."""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import click

from bsg_cli.terminal import (
    CommandGroup,
    force_option,
    format_table,
    json_option,
    print_json,
    print_note,
    progress_bar,
    seed_option,
    worker_pool,
    workers_option,
)
from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.coverage import measure_coverage
from bsg_data.dataset.frequencies import count_frequencies, plot_frequencies
from bsg_data.dataset.histograms import read_adjacency
from bsg_data.dataset.manifest import Manifest, read_manifest
from bsg_data.dataset.splits import read_splits, split_dataset
from bsg_data.errors import BSGError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, list_class_maps, load_class_map
from bsg_data.scene.mesh_coverage import MeshCoverage
from bsg_data.sources.catalogue import SOURCES, open_source
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HM3DStatistics
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.sources.source import Source
from bsg_data.synthetic.buildings import MAX_SCENES, write_synthetic
from bsg_data.synthetic.geometry import GeometryOptions
from bsg_data.synthetic.meshes import SIZES


class _Fraction(click.FloatRange):
    """A number from 0 to 1; `nan` is none, though no comparison would refuse it."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value} is no number", param, ctx)
        return float(number)


FRACTION = _Fraction(0, 1)
dataset_argument = click.argument(
    "dataset", type=click.Path(path_type=Path, file_okay=False), metavar="DATASET"
)
class_map_option = click.option(
    "--class-map",
    default=DEFAULT_CLASS_MAP,
    show_default=True,
    help="A published version, or the path of your own NAME.csv.",
)


@click.group(cls=CommandGroup)
@click.version_option(package_name="belief-scene-graphs", prog_name="bsg-data")
def main() -> None:
    """Turn HM3D's annotations into datasets of 3D scene graphs.

    \b
    Example:
      bsg-data synth --out buildings --scenes 20
      bsg-data build --hm3d buildings --out dataset
      bsg-data split dataset
      bsg-data pairs dataset
      bsg-data check dataset
    """


@main.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder to write.")
@click.option(
    "--scenes",
    type=click.IntRange(1, MAX_SCENES),
    default=20,
    show_default=True,
    help="How many buildings.",
)
@click.option(
    "--geometry",
    is_flag=True,
    help="Write meshes too, with what is true of them in <hash>.truth.json.",
)
@click.option(
    "--size",
    type=click.Choice(list(SIZES)),
    help="With --geometry: how fine; full is as large as a real one.  [default: small]",
)
@click.option(
    "--coloured-by",
    type=click.Choice(["texture", "vertex", "both"]),
    help="With --geometry: where the colours are.  [default: texture]",
)
@click.option(
    "--up-axis",
    type=click.Choice(["y", "z"]),
    help="With --geometry: which axis points up.  [default: y and z in turn]",
)
@seed_option
@workers_option
@force_option
@json_option
def synth(
    out: Path,
    scenes: int,
    geometry: bool,
    size: str | None,
    coloured_by: str | None,
    up_axis: str | None,
    seed: int,
    workers: int,
    force: bool,
    as_json: bool,
) -> None:
    """Write synthetic buildings in HM3D's own layout.

    \b
    Example:
      bsg-data synth --out buildings --scenes 20 --seed 0
      bsg-data synth --out places --scenes 5 --geometry
    """
    chosen = {"size": size, "coloured_by": coloured_by, "up_axis": up_axis}
    given = {name: value for name, value in chosen.items() if value is not None}
    if given and not geometry:
        raise click.UsageError(f"--{next(iter(given)).replace('_', '-')} needs --geometry")
    options = GeometryOptions(**given) if geometry else None  # type: ignore[arg-type]
    pool = worker_pool(workers if geometry else 1)  # without meshes one process is quicker
    with pool as executor, progress_bar("synth", unit="scene") as report:
        writing = write_synthetic(
            out, scenes=scenes, seed=seed, geometry=options, force=force, executor=executor
        )
        for done, _ in enumerate(writing, 1):
            report(done, scenes)
    if as_json:
        print_json({"out": str(out), "scenes": scenes, "seed": seed, "geometry": geometry})
    else:
        click.echo(f"{scenes} synthetic buildings{' with meshes' * geometry} in {out}")


@main.command()
@click.option("--hm3d", type=click.Path(path_type=Path), help="Folder above HM3D's annotations.")
@click.option("--hm3d-stats", type=click.Path(path_type=Path), help="The public HM3DSem-*.zip.")
@click.option(
    "--source",
    "named",
    type=(str, click.Path(path_type=Path)),
    metavar="NAME PATH",
    help=f"Any source by its name: {', '.join(SOURCES)}.",
)
@click.option(
    "--meshes/--no-meshes",
    default=True,
    show_default=True,
    help="Read <hash>.semantic.glb beside an annotation.",
)
@click.option(
    "--snap-colours",
    type=click.IntRange(0, 255),
    help="Read JPEG textures: a texel is the nearest listed colour's within N a channel, 8 say.",
)
@click.option(
    "--room-layouts",
    type=click.Path(path_type=Path),
    help="Folder of DomestiGraph YAML: labels, boxes and connections of rooms.",
)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Dataset to write.")
@class_map_option
@workers_option
@click.option(
    "--strict", is_flag=True, help="Fail on a malformed scene, mesh or layout, or an unmapped name."
)
@force_option
@json_option
def build(
    hm3d: Path | None,
    hm3d_stats: Path | None,
    named: tuple[str, Path] | None,
    meshes: bool,
    snap_colours: int | None,
    room_layouts: Path | None,
    out: Path,
    class_map: str,
    workers: int,
    strict: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Build a dataset of scene graphs from one source.

    A build that was stopped goes on where it was when the same command runs again.

    \b
    Example:
      bsg-data build --hm3d buildings --out dataset
      bsg-data build --hm3d buildings --no-meshes --room-layouts layouts --out dataset
    """
    source = _choose_source(hm3d, hm3d_stats, named, meshes=meshes, snap_colours=snap_colours)
    if room_layouts is not None:
        source = WithLayouts(source, room_layouts)
    try:
        with worker_pool(workers) as executor, progress_bar("build", unit="shard") as report:
            manifest = build_dataset(
                source,
                out,
                class_map=class_map,
                strict=strict,
                force=force,
                executor=executor,
                progress=report,
            )
    except (BSGError, KeyboardInterrupt):
        if out.with_name(f"{out.name}.partial").is_dir():
            print_note(f"what is done is in {out}.partial; the same command goes on from there")
        raise
    if as_json:
        print_json(manifest.model_dump(mode="json", exclude={"files"}))
        return
    click.echo(_totals_line(manifest))
    click.echo(_losses(manifest))
    click.echo(f"dataset in {out}")


@main.command()
@dataset_argument
@click.option(
    "--ratios",
    type=float,
    nargs=3,
    metavar="TRAIN VAL TEST",
    help="Shares that add up to 1.  [default: 0.8 0.1 0.1]",
)
@click.option(
    "--official", is_flag=True, help="The source's val as test; val carved from its train."
)
@click.option("--folds", type=click.IntRange(min=3), help="K folds for cross-validation.")
@seed_option
@force_option
@json_option
def split(
    dataset: Path,
    ratios: tuple[float, float, float] | None,
    official: bool,
    folds: int | None,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Assign every building to train, val or test, or to a fold.

    \b
    Example:
      bsg-data split dataset --ratios 0.8 0.1 0.1 --seed 0
    """
    if (ratios is not None) + (folds is not None) + official > 1:
        raise click.UsageError("--ratios, --official and --folds exclude each other")
    if official:
        recipe = SplitRecipe(method="official", seed=seed, ratios=(0.9, 0.1, 0.0))
    elif folds is not None:
        recipe = SplitRecipe(method="folds", seed=seed, ratios=None, folds=folds)
    else:
        recipe = SplitRecipe(seed=seed, ratios=ratios or (0.8, 0.1, 0.1))
    manifest = split_dataset(dataset, recipe, force=force)
    sizes = {name: len(ids) for name, ids in read_splits(dataset, manifest=manifest).items()}
    if as_json:
        print_json({"recipe": recipe.model_dump(mode="json"), "scenes": sizes})
    else:
        click.echo(", ".join(f"{name} {size}" for name, size in sizes.items()) + " buildings")


@main.command()
@dataset_argument
@click.option(
    "--mask",
    type=click.Choice(["uniform", "rooms", "frontier"]),
    default="uniform",
    show_default=True,
    help="How objects are hidden.",
)
@click.option(
    "--fraction",
    type=FRACTION,
    default=0.5,
    show_default=True,
    help="Share of a building's objects to hide.",
)
@click.option(
    "--draws",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="Masks of every building.",
)
@seed_option
@workers_option
@force_option
@json_option
def pairs(
    dataset: Path,
    mask: str,
    fraction: float,
    draws: int,
    seed: int,
    workers: int,
    force: bool,
    as_json: bool,
) -> None:
    """Draw masks and write input and target histograms.

    \b
    Example:
      bsg-data pairs dataset --mask uniform --fraction 0.5 --draws 10
    """
    recipe = PairsRecipe(
        mask=MaskRecipe.model_validate({"strategy": mask, "fraction": fraction, "seed": seed}),
        draws=draws,
    )
    with worker_pool(workers) as executor, progress_bar("pairs", unit="file") as report:
        manifest = write_pairs(dataset, recipe, force=force, executor=executor, progress=report)
    rows = sum(entry.rows for entry in manifest.files_of("pairs"))
    if mask == "frontier":
        bare = manifest.totals.scenes - len(read_adjacency(dataset, manifest=manifest))
        if bare:
            print_note(
                f"{bare:,} of {manifest.totals.scenes:,} scenes have no adjacency: there every "
                "room neighbours every other"
            )
    if as_json:
        print_json({"recipe": recipe.model_dump(mode="json"), "rows": rows})
    else:
        click.echo(f"{rows:,} pairs: {draws} draws of mask {mask}, fraction {fraction}")


@main.command()
@dataset_argument
@json_option
def check(dataset: Path, as_json: bool) -> None:
    """Prove that a dataset is sound: hashes, schemas, keys, counts, splits, masks.

    \b
    Example:
      bsg-data check dataset
    """
    with progress_bar("check", unit="file") as report:
        faults = check_dataset(dataset, progress=report)
    if as_json:
        print_json(
            {"sound": not faults, "faults": [{"where": f.where, "what": f.what} for f in faults]}
        )
    elif faults:
        click.echo("\n".join(f"{fault.where}: {fault.what}" for fault in faults))
    else:
        click.echo(f"{dataset}: sound")
    if faults:
        print_note(f"faults: {len(faults)}; what a command made, it makes again with --force")
        raise click.exceptions.Exit(1)


@main.command()
@dataset_argument
@click.option("--figure", type=click.Path(path_type=Path), help="Draw the frequencies as an image.")
@json_option
def info(dataset: Path, figure: Path | None, as_json: bool) -> None:
    """Say what a dataset holds, with the frequency of every class.

    \b
    Example:
      bsg-data info dataset --figure classes.png
    """
    manifest = read_manifest(dataset)
    frame = count_frequencies(dataset)
    sizes = read_splits(dataset, manifest=manifest) if manifest.split else {}
    if figure is not None:
        plot_frequencies(frame, figure, title=_totals_line(manifest))
    if as_json:
        summary = manifest.model_dump(mode="json", exclude={"files"})
        summary["splits"] = {name: len(ids) for name, ids in sizes.items()}
        print_json({**summary, "classes": frame.to_dict(orient="records")})
        return
    click.echo(_totals_line(manifest))
    click.echo(_losses(manifest))
    held = ", ".join(f"{name} {len(ids)}" for name, ids in sizes.items())
    click.echo(f"splits: {held or 'none yet (bsg-data split)'}")
    recipe = manifest.pairs
    if recipe is None:
        click.echo("pairs: none yet (bsg-data pairs)")
    else:
        mask = recipe.mask
        click.echo(f"pairs: {recipe.draws} draws of {mask.strategy}, fraction {mask.fraction}")
    most = max(1, int(frame["instances"].max()))
    rows = [
        (row["class"], row["instances"], row["rooms"], row["scenes"], _bar(row["instances"] / most))
        for row in frame.to_dict(orient="records")
    ]
    click.echo("\n" + format_table(rows, header=("class", "instances", "rooms", "scenes", "")))
    if figure is not None:
        print_note(f"figure in {figure}")


@main.group("map", cls=CommandGroup)
def class_map_group() -> None:
    """Look into class maps.

    \b
    Example:
      bsg-data map show "trash can"
    """


@class_map_group.command("list")
@json_option
def map_list(as_json: bool) -> None:
    """List the published class maps.

    \b
    Example:
      bsg-data map list
    """
    maps = [load_class_map(version) for version in list_class_maps()]
    if as_json:
        fields = [{"version": m.version, "sha256": m.sha256, "classes": m.classes} for m in maps]
        print_json(fields)
        return
    rows = [(m.version, len(m.classes), len(m.entries), m.sha256) for m in maps]
    click.echo(format_table(rows, header=("version", "classes", "spellings", "sha256")))


@class_map_group.command("show")
@click.argument("category")
@class_map_option
@json_option
def map_show(category: str, class_map: str, as_json: bool) -> None:
    """Show what a category, or every spelling of a class, is mapped to.

    \b
    Example:
      bsg-data map show "trash can"
    """
    loaded = load_class_map(class_map)
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
        "definition": None if index is None else loaded.definitions[index],
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
        click.echo(f"class {index}, {category}: {loaded.definitions[index]}")
        click.echo(f"{len(spellings)} spellings: {', '.join(map(repr, spellings))}")
    if not known:
        raise click.exceptions.Exit(1)


@class_map_group.command("coverage")
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
    loaded = load_class_map(class_map or read_manifest(dataset).class_map.version)
    found = measure_coverage(dataset, loaded)
    parts = ("objects", "classified", "structure", "nameless", "unmapped", "left_out")
    counts = {part: int(getattr(found, part)) for part in parts}
    if as_json:
        shares = {"share": found.share, "share_of_named": found.share_of_named}
        print_json({**counts, **shares, "most_left_out": dict(found.most_left_out)})
        return
    rows = [(part.replace("_", " "), count) for part, count in counts.items()]
    click.echo(format_table(rows, header=(loaded.version, "instances")))
    click.echo(f"\nclassified, of what is not structure: {found.share:.1%}")
    click.echo(f"classified, of what is not structure and has a name: {found.share_of_named:.1%}")
    rows = list(found.most_left_out)
    if rows:
        click.echo("\n" + format_table(rows, header=("most frequent left out", "instances")))


def _choose_source(
    hm3d: Path | None,
    hm3d_stats: Path | None,
    named: tuple[str, Path] | None,
    *,
    meshes: bool,
    snap_colours: int | None,
) -> Source:
    if [hm3d, hm3d_stats, named].count(None) != 2:
        raise click.UsageError(
            "give one source: --hm3d PATH, --hm3d-stats ZIP or --source NAME PATH"
        )
    if snap_colours is not None and not meshes:
        raise click.UsageError("--snap-colours is of meshes: it excludes --no-meshes")
    if named is not None:
        name, path = named
        options: dict[str, object] = {} if meshes else {"meshes": False}
        if snap_colours is not None:
            options["snap_colours"] = snap_colours
        return open_source(name, path, **options)
    if hm3d is not None:
        return HM3DFolder(hm3d, meshes=meshes, snap_colours=snap_colours)
    if snap_colours is not None or not meshes:
        raise click.UsageError("the statistics have no meshes: --snap-colours needs --hm3d")
    return HM3DStatistics(Path(str(hm3d_stats)))


def _totals_line(manifest: Manifest) -> str:
    t = manifest.totals
    placed = (
        f"; {t.placed:,} with geometry, {t.adjacent:,} pairs of adjacent rooms" if t.placed else ""
    )
    return (
        f"{t.scenes:,} scenes, {t.rooms:,} rooms, {t.objects:,} objects, "
        f"{t.classified:,} in {len(manifest.class_map.classes)} classes of "
        f"{manifest.class_map.version}{placed}"
    )


def _losses(manifest: Manifest, *, most: int = 20) -> str:
    """Return what was skipped, left out or not explained, as readable tables."""
    left = manifest.left_out
    lines = [
        f"skipped scenes: {len(manifest.skipped):,}, unmapped objects: {manifest.totals.unmapped:,}"
    ]
    if manifest.meshes:
        lines.append(_mesh_line(list(manifest.meshes.values())))
        bare = manifest.totals.scenes - len({*manifest.meshes, *(s.scene_id for s in left)})
        if bare > 0:
            lines.append(f"scenes without a mesh beside their annotation: {bare:,}")
    for entries, what in (
        (manifest.skipped, "skipped scene"),
        (left, "geometry left out"),
    ):
        if entries:
            rows = [(entry.scene_id, entry.location, entry.reason) for entry in entries[:most]]
            lines.append(format_table(rows, header=(what, "location", "reason")))
    if manifest.unmapped:
        names = [(u.name, u.instances, ", ".join(u.nearest)) for u in manifest.unmapped[:most]]
        lines.append(format_table(names, header=("unmapped name", "instances", "nearest")))
    counts = (len(manifest.skipped), len(left), len(manifest.unmapped))
    if max(counts) > most:
        lines.append("… dataset.json lists them all")
    return "\n".join(lines)


def _mesh_line(meshes: list[MeshCoverage]) -> str:
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
        f"meshes: {len(meshes):,}; {pixels}{listed:.1%} of {area:,.0f} m² "
        f"is listed; listed objects without a surface: {missing:,}"
    )


def _bar(share: float) -> str:
    width = shutil.get_terminal_size().columns
    return "█" * round(share * max(10, min(50, width - 50))) or "▏" * (share > 0)
