"""`bsg-models`: list, show, check and download models."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_models
from bsg_cli.choices import complete_model
from bsg_cli.options import PATH, force_option, json_option
from bsg_cli.terminal import Command, CommandGroup, print_json, print_note, print_text
from bsg_data.errors import BSGError
from bsg_data.tables import format_text


@click.group("bsg-models", cls=CommandGroup)
def main() -> None:
    """List the shipped models, check results, and download models from the hub.

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
    models = bsg_models.list_shipped()
    if as_json:
        print_json([model.model_dump(mode="json", exclude={"card", "config"}) for model in models])
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
@click.argument("name", metavar="NAME|FOLDER|HUB-ID", shell_complete=complete_model)
@json_option
def show(name: str, as_json: bool) -> None:
    """Show the card and the checkpoint of a model.

    \b
    Example:
      bsg-models show universal
    """
    model = bsg_models.summarise_model(name)
    if as_json:
        print_json(model.model_dump(mode="json"))
        return
    facts = [
        ("name", f"{model.name} ({model.kind})"),
        ("model of the zoo", model.zoo_name),
        ("classes", f"{model.classes} of {model.class_space} ({model.class_space_sha256})"),
        ("bytes", f"{model.bytes:,}"),
        ("sha256", model.sha256),
    ]
    # The front matter is for the hub; the card repeats it in words.
    print_text(model.card.partition("\n---\n")[2].strip() + "\n")
    print_text(format_text(facts, header=("checkpoint", "")))


@main.command(cls=Command)
@click.argument("paths", metavar="PATH...", type=PATH, nargs=-1, required=True)
def check(paths: tuple[Path, ...]) -> None:
    """Check that no byte of a result changed after it was written.

    A PATH is a run, a folder of belief tables, an evaluation, a search, a leaderboard, or a
    checkpoint.

    \b
    Example:
      bsg-models check run
      bsg-models check beliefs run/evaluation
    """
    faults = 0
    for path in paths:
        try:
            files = bsg_models.check_results(path)
        except BSGError as error:
            print_note(f"Error: {error}")
            faults += 1
            continue
        print_text(f"{path}: sound ({len(files)} files)" if len(files) > 1 else f"{path}: sound")
    if faults:
        raise click.exceptions.Exit(1)


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
@click.argument("name", metavar="NAME|FOLDER|HUB-ID", shell_complete=complete_model)
@click.argument("file", metavar="FILE.onnx", type=PATH)
@force_option
def export(name: str, file: Path, force: bool) -> None:
    """Write a network as ONNX, for programs in other languages.

    Its classes and words lie beside it as JSON; docs/onnx.md says its inputs and outputs.

    \b
    Example:
      bsg-models export universal universal.onnx
    """
    beside = bsg_models.export_onnx(name, file, force=force)
    print_text(f"written: {file}, {beside}")
