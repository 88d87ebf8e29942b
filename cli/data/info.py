"""`bsg-data info` and `check`: describe a dataset, and prove that it is sound."""

from __future__ import annotations

import shutil
from dataclasses import asdict
from pathlib import Path

import click

import bsg_data
from bsg_cli.data.totals import format_hashes, format_losses, format_sources, format_totals
from bsg_cli.options import PATH, dataset_argument, json_option, refuse_unused
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data import extend
from bsg_data.tables import format_text


@click.command("info", cls=Command)
@dataset_argument
@click.option("--figure", type=PATH, help="Also draw the frequencies as an image.")
@click.option("--force", is_flag=True, help="Replace the image.")
@json_option
def info(dataset: Path, figure: Path | None, force: bool, as_json: bool) -> None:
    """Describe a dataset, with the frequency of every class.

    \b
    Example:
      bsg-data info dataset --figure classes.png
    """
    data = bsg_data.Dataset.open(dataset)
    manifest = data.manifest
    if figure is None:
        refuse_unused(("force",), "info without --figure")
    else:
        extend.refuse_file(figure, force=force)
    classes = sorted(extend.count_classes(data), key=lambda row: (-row["instances"], row["class"]))
    splits = {name: len(ids) for name, ids in data.splits.items()}
    hashes = extend.hash_splits(data) if manifest.pairs else {}
    if figure is not None:
        extend.plot_frequencies(classes, figure, title=format_totals(manifest))
    if as_json:
        summary = manifest.model_dump(mode="json", exclude={"files"})
        sources = extend.count_sources(data)
        more = {"splits": splits, "by_source": sources, "masks_sha256": hashes, "classes": classes}
        print_json(summary | more)
        return
    print_text(format_totals(manifest))
    print_text(f"format version {manifest.format_version}, class map {manifest.class_map_names}")
    print_text(format_losses(manifest))
    print_text(f"\n{format_sources(data)}\n")
    held = ", ".join(f"{name} {number}" for name, number in splits.items())
    print_text(f"splits: {held or 'none yet (bsg-data split)'}")
    recipe = manifest.pairs
    if recipe is None:
        print_text("pairs: none yet (bsg-data pairs)")
    else:
        print_text(f"pairs: {recipe.draws} draws of {recipe.mask}\n{format_hashes(hashes)}")
    largest = max(1, *(row["instances"] for row in classes))
    rows = [(*row.values(), _bar(row["instances"] / largest)) for row in classes]
    print_text("\n" + format_text(rows, header=("class", "instances", "rooms", "buildings", "")))
    if figure is not None:
        print_note(f"figure in {figure}")


def _bar(share: float) -> str:
    width = shutil.get_terminal_size().columns
    return "█" * round(share * max(10, min(50, width - 50))) or "▏" * (share > 0)


@click.command("check", cls=Command)
@dataset_argument
@json_option
def check(dataset: Path, as_json: bool) -> None:
    """Check hashes, schemas, counts, splits and masks.

    \b
    Example:
      bsg-data check dataset
    """
    with progress_bar("check", unit="file") as report:
        faults = bsg_data.check_dataset(dataset, progress=report)
    if as_json:
        print_json({"sound": not faults, "faults": list(map(asdict, faults))})
    else:
        lines = "\n".join(f"{fault.where}: {fault.what}" for fault in faults)
        print_text(lines or f"{dataset}: sound")
    if faults:
        print_note(
            f"faults: {len(faults)}; repair: run an interrupted command again, copy a damaged file "
            "from another copy, or write it again with --force"
        )
        raise click.exceptions.Exit(1)
