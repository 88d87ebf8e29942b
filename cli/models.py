"""`bsg-models`: list, show, verify, download and export models."""

from __future__ import annotations

import re
from pathlib import Path

import click

import bsg_models
from bsg_cli.choices import complete_model
from bsg_cli.options import PATH, force_option, json_option, out_option
from bsg_cli.terminal import Command, CommandGroup, print_json, print_note, print_text
from bsg_cli.train import print_run
from bsg_data.errors import BSGError, DatasetError
from bsg_data.files import resolve_links
from bsg_data.seal import SEAL, require_seal
from bsg_data.tables import format_text


@click.group("bsg-models", cls=CommandGroup)
def main() -> None:
    """List the shipped models, verify results, and download or export models.

    \b
    Example:
      bsg-models list
      bsg-models show universal
    """


@main.command("list", cls=Command)
@json_option
def list_models(as_json: bool) -> None:
    """List the shipped models.

    \b
    Example:
      bsg-models list
    """
    # Imported here, as in the other commands: a help must not wait for it.
    from bsg_models.runs.model_card import list_shipped

    models = list_shipped()
    if as_json:
        print_json([model.model_dump(mode="json", exclude={"card"}) for model in models])
        return
    if not models:
        print_note("no models are shipped with this build")
        return
    header = ("name", "classes", "size", "trained on", "licence", "for")
    rows = [(m.name, m.classes, _name_size(m.bytes), m.data, m.licence, m.purpose) for m in models]
    print_text(format_text(rows, header=header, numeric=("size",)))


def _name_size(number: int) -> str:
    """Return a number of bytes in MB, or in kB below 100,000."""
    return f"{number / 1e6:.1f} MB" if number >= 100_000 else f"{number / 1e3:.0f} kB"


@main.command(cls=Command)
@click.argument("name", metavar="NAME|RUN|FILE", shell_complete=complete_model)
def show(name: str) -> None:
    """Show the card of a model, and how it was trained.

    \b
    Example:
      bsg-models show universal
      bsg-models show run
    """
    from bsg_models.runs.model_card import summarise_model

    model = summarise_model(name)
    facts = [
        ("name", f"{model.name} ({model.kind})"),
        ("model of the zoo", model.zoo_name),
        ("classes", f"{model.classes} of {model.class_space} ({model.class_space_sha256})"),
        ("bytes", f"{model.bytes:,}"),
        ("sha256", model.sha256),
    ]
    # The front matter is for the hub; the card repeats it in words.
    card = model.card.partition("\n---\n")[2].strip()
    print_text(re.sub(r"<!-- .* -->\n", "", card) + "\n")
    print_text(format_text(facts, header=("checkpoint", "")))
    if model.kind == "run":
        print_text("")
        _print_training(Path(name))


def _print_training(run: Path) -> None:
    """Print what a run is and how it was trained."""
    from bsg_models.runs.checkpoint import read_header
    from bsg_models.runs.checkpoint_file import BEST
    from bsg_models.runs.run_folder import CONFIG, read_record

    require_seal(run)
    print_run(run)
    header, record = read_header(run / BEST), read_record(run)
    print_text(
        f"seed {header.config.seed}; to train it again: "
        f"bsg-train DATASET --config {run / CONFIG} --out RUN\n"
    )
    if record is not None:
        versions = [record.versions.get(name, "?") for name in ("belief-scene-graphs", "torch")]
        row = (record.time, f"{record.seconds:.1f}", header.dataset_sha256[:12], *versions)
        print_text(format_text([row], header=("trained", "seconds", "dataset", "version", "torch")))


@main.command(cls=Command)
@click.argument("paths", metavar="PATH...", type=PATH, nargs=-1, required=True)
def verify(paths: tuple[Path, ...]) -> None:
    """Verify that no byte of a result changed after it was written.

    A PATH is a run, an evaluation, a search, a leaderboard, or a checkpoint.

    \b
    Example:
      bsg-models verify run
      bsg-models verify run/evaluation search
    """
    sound = True
    for path in paths:
        try:
            files = _count_sound(path)
        except BSGError as error:
            print_note(f"Error: {error}")
            sound = False
            continue
        print_text(f"{path}: sound ({files} files)" if files > 1 else f"{path}: sound")
    if not sound:
        raise click.exceptions.Exit(1)


def _count_sound(path: Path) -> int:
    """Return the number of files of a result, all of which are as they were written."""
    from bsg_data.dataset.manifest import MANIFEST
    from bsg_models.runs.run_folder import list_outdated

    if path.is_file():
        from bsg_models.runs.checkpoint import load_checkpoint

        load_checkpoint(path)
        return 1
    sums = require_seal(path)
    if not sums:
        hint = f"has no {SEAL}: it is no folder of results, or its command was stopped"
        if (path / MANIFEST).is_file():
            hint = f"is a dataset; `bsg-data check {path}` checks it"
        raise DatasetError(f"{path}: {hint}", code="seal-missing", where=path)
    folder = resolve_links(path)
    if folder in list_outdated(folder.parent):
        print_note(f"{path}: measures other weights than its run has now; measure the run again")
    return len(sums)


@main.command(cls=Command)
@click.argument("name", metavar="OWNER/NAME")
def download(name: str) -> None:
    """Download a model from the Hugging Face hub.

    No other command downloads anything.

    \b
    Example:
      bsg-models download somebody/their-rooms
    """
    path = bsg_models.download(name)
    print_text(f"{name} is in {path}; next: bsg-belief graph.json --model {name}")


@main.command(cls=Command)
@click.argument("name", metavar="NAME|RUN|FILE", shell_complete=complete_model)
@out_option("File NAME.onnx.", required=True)
@force_option
def export(name: str, out: Path, force: bool) -> None:
    """Write a network as ONNX, for programs in other languages.

    Its classes and words lie beside it as JSON; docs/robot-software.md says its inputs and outputs.

    \b
    Example:
      bsg-models export universal --out universal.onnx
    """
    from bsg_models.training.onnx_file import export_onnx

    beside = export_onnx(name, out, force=force)
    print_text(f"written: {out}, {beside}")
