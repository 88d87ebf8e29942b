"""`bsg-data info`: describe a dataset."""

from __future__ import annotations

import shutil
from pathlib import Path

import click

import bsg_data
from bsg_cli.data.totals import format_hashes, format_losses, format_sources, format_totals
from bsg_cli.options import PATH, dataset_argument, json_option
from bsg_cli.terminal import Command, print_json, print_note, print_text
from bsg_data import extend
from bsg_data.tables import format_text


@click.command("info", cls=Command)
@dataset_argument
@click.option("--figure", type=PATH, help="Also draw the frequencies as an image.")
@click.option(
    "--force", is_flag=True, help="Replace a file at --figure that this program did not write."
)
@json_option
def command(dataset: Path, figure: Path | None, force: bool, as_json: bool) -> None:
    """Describe a dataset, with the frequency of every class.

    \b
    Example:
      bsg-data info dataset --figure classes.png
    """
    manifest = bsg_data.read_manifest(dataset)
    if figure is not None:
        extend.refuse_figure(figure, force=force)
    frame = extend.count_frequencies(dataset)
    sizes = bsg_data.read_splits(dataset, manifest=manifest) if manifest.split else {}
    hashes = extend.hash_splits(bsg_data.Dataset.open(dataset)) if manifest.pairs else {}
    if figure is not None:
        extend.plot_frequencies(frame, figure, title=format_totals(manifest))
    if as_json:
        summary = manifest.model_dump(mode="json", exclude={"files"})
        summary["splits"] = {name: len(ids) for name, ids in sizes.items()}
        sources = extend.count_sources(dataset, manifest=manifest).to_dict(orient="records")
        summary["by_source"] = sources
        summary["masks_sha256"] = hashes
        print_json({**summary, "classes": frame.to_dict(orient="records")})
        return
    print_text(format_totals(manifest))
    print_text(f"format version {manifest.format_version}, class map {manifest.class_map_names}")
    print_text(format_losses(manifest))
    print_text(f"\n{format_sources(dataset)}\n")
    held = ", ".join(f"{name} {len(ids)}" for name, ids in sizes.items())
    print_text(f"splits: {held or 'none yet (bsg-data split)'}")
    recipe = manifest.pairs
    if recipe is None:
        print_text("pairs: none yet (bsg-data pairs)")
    else:
        print_text(f"pairs: {recipe.draws} draws of {recipe.mask}")
        print_text(format_hashes(hashes))
    most = max(1, int(frame["instances"].max()))
    rows = [
        (row["class"], row["instances"], row["rooms"], row["scenes"], _bar(row["instances"] / most))
        for row in frame.to_dict(orient="records")
    ]
    print_text("\n" + format_text(rows, header=("class", "instances", "rooms", "scenes", "")))
    if figure is not None:
        print_note(f"figure in {figure}")


def _bar(share: float) -> str:
    width = shutil.get_terminal_size().columns
    return "█" * round(share * max(10, min(50, width - 50))) or "▏" * (share > 0)
