"""`bsg-belief`: say what a trained model expects in a partial graph."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import bsg_data
import bsg_models
from bsg_cli.find import find_things
from bsg_cli.options import (
    PATH,
    choice_option,
    data_option,
    force_option,
    html_option,
    json_option,
    mask_options,
    model_option,
    number_option,
    out_option,
    rerun_option,
    seed_option,
    split_option,
)
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data.tables import format_text

if TYPE_CHECKING:
    from bsg_models.belief.graph_file import GraphFile

_MOST_ROWS = 60


@click.command("bsg-belief", cls=Command)
@click.argument("graphs", type=PATH, nargs=-1, metavar="[GRAPH]...")
@model_option("A shipped model, a trained run, or a model of the hub.  [default: universal]")
@data_option("Instead of GRAPHs: mask buildings of this dataset.", required=False)
@split_option("With --data: the split.", default="val")
@click.option("--fold", type=click.IntRange(min=0), help="With --data and folds: the fold.")
@click.option("--scene", help="With --data: only this building.")
@mask_options("With --data: how to hide objects.", "With --data: share of the objects to hide.")
@seed_option("With --data: seed of the masks.")
@click.option("--labels", metavar="SPACE", help="Label space of Hydra: mpcat40, ade20k, or a file.")
@click.option(
    "--hidden-share",
    "shares",
    multiple=True,
    metavar="[ROOM=]SHARE",
    help="Share of a room's objects that the robot has not seen, from 0 (searched) to 1 (not "
    "entered); without ROOM for all other rooms.",
)
@click.option(
    "--find",
    metavar="THING",
    multiple=True,
    help="Say where a thing is, and where to go first. THING is any word. Repeat it for several.",
)
@click.option("--from", "here", metavar="ROOM", help="With --find: the room of the robot.")
@choice_option(
    "--mode",
    ["complete", "unseen"],
    "Blind nodes to add: as many as expected, or one for each top unseen class.",
    default="complete",
)
@number_option("--top", "Number of unseen classes per room.", default=3)
@out_option(
    "Write the belief graphs. The suffix sets the format: .json, .tables, .dsg.json, .html or .rrd."
)
@click.option(
    "--hydra",
    type=PATH,
    help="Write one graph as Spark-DSG JSON. A graph of Hydra keeps all that it had.",
)
@click.option("--tables", type=PATH, help="Write all graphs as a folder of parquet tables.")
@html_option("Write the explorer, one HTML page.")
@rerun_option("Write a recording for the Rerun viewer; each GRAPH is one step of its time.")
@force_option
@json_option
def main(
    dataset: Path | None, as_json: bool, find: tuple[str, ...], here: str | None, **options: Any
) -> None:
    """Say which unseen objects a model expects in each room, or where one thing is.

    A GRAPH is a robot's partial graph: our JSON (docs/belief.md) or Spark-DSG JSON; `-` is
    standard input. The model is looked up in this order: an existing path, a shipped model
    (`bsg-models list`), a folder of that name, a downloaded OWNER/NAME (`bsg-models download`).

    \b
    Example:
      bsg-belief graph.json --find microwave --from hall
      bsg-belief graph.json --html belief.html
      bsg-belief graph.json later.json --rerun growing.rrd
      bsg-belief dsg.json --labels mpcat40 --hydra annotated.json
      bsg-belief graph.json --model run --out belief.json --html belief.html
      bsg-belief --data dataset --split val --model run --tables beliefs
    """
    if bool(options["graphs"]) == (dataset is not None):
        raise click.UsageError("expected either GRAPHs or --data DATASET; give one of them")
    if here is not None and not find:
        raise click.UsageError("--from needs --find THING; give both or neither")
    if find:
        _check_find(options)
    named, labels = options.pop("model"), options.pop("labels")
    shares = _read_shares(options.pop("shares"), dataset)
    files = [_open_graph(path, labels, shares, options["out"]) for path in options.pop("graphs")]
    model = bsg_models.DEFAULT_MODEL if named is None else named
    if find:
        _ask(files[0], model, find, here=here, as_json=as_json, announce=named is None)
        return
    names = ("fraction", "seed", "withhold", "parts")
    mask = {"strategy": options.pop("mask"), **{name: options.pop(name) for name in names}}
    request = bsg_models.BeliefRequest(
        run=model,
        graphs=tuple(files),
        dataset=dataset,
        mask=bsg_data.MaskRecipe.model_validate(mask),
        **options,
    )
    with progress_bar("belief", unit="graph") as progress:
        report = bsg_models.report_beliefs(request, progress=progress)
    if named is None:
        print_note(f"model: {bsg_models.describe_model()}")
    for file, notes in zip(files, report.notes, strict=False):
        for note in notes:
            print_note(f"{file.path}: {note}")
    if as_json:
        print_json([_encode_room(room) for room in report.rooms])
        return
    _print_rooms(report)
    if request.html and len(report.graphs) < report.number:
        print_note(
            f"{request.html}: shows the first {len(report.graphs):,} of {report.number:,} graphs; "
            "--tables writes all"
        )
    if written := [str(path) for _, path in request.list_results()]:
        print_text(f"written: {', '.join(written)}")


def _check_find(options: dict[str, Any]) -> None:
    """Refuse several graphs, and options that `--find` does not use."""
    context = click.get_current_context()
    for name in ("mode", "top", "split", "fold", "scene", "force"):
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--find does not use --{name}; leave one of them out")
    if len(options["graphs"]) != 1:
        found = len(options["graphs"]) or "--data"
        raise click.UsageError(f"--find: expected one GRAPH, found {found}")
    written = [name for name in ("out", "hydra", "tables", "html", "rerun") if options[name]]
    if written:
        raise click.UsageError(f"--find writes no files; leave out --find or --{written[0]}")


def _ask(
    file: GraphFile,
    model: Path | str,
    things: Sequence[str],
    *,
    here: str | None,
    as_json: bool,
    announce: bool,
) -> None:
    # Imported here, as in the next: a help or a typo must not wait for SciPy and torch.
    from bsg_data.observation.partial_graph import reclassify
    from bsg_models.robot.words import find_room

    if here is not None:
        find_room(file.graph, here)
    predictor = bsg_models.Predictor(model)
    graph = reclassify(file.graph, predictor.class_map)
    if announce:
        print_note(f"model: {bsg_models.describe_model()}")
    seen = bsg_models.SeenBuilding(graph, predictor, notes=file.notes)
    for note in seen.notes:
        print_note(f"{file.path}: {note}")
    find_things(seen, tuple(dict.fromkeys(things)), here=here, as_json=as_json)


def _open_graph(
    path: Path, labels: str | None, shares: dict[str, Any], out: Path | None
) -> GraphFile:
    """Read a robot's graph once, before models are imported, which is slow."""
    from bsg_models.belief.formats import choose_format
    from bsg_models.belief.graph_file import open_graph_file
    from bsg_models.robot.words import set_hidden_shares

    if out is not None:
        choose_format(out)
    file = open_graph_file(path, labels=labels)
    return replace(file, graph=set_hidden_shares(file.graph, **shares))


def _read_shares(said: Sequence[str], dataset: Path | None) -> dict[str, Any]:
    """Return the hidden shares of `--hidden-share`: `0.4` for all rooms, `kitchen=0.2` for one."""
    if said and dataset is not None:
        raise click.UsageError("--hidden-share needs GRAPHs; with --data give --mask instead")
    shares: dict[str, float] = {}  # by room; the empty name stands for all other rooms
    for word in said:
        room, _, number = word.rpartition("=")
        try:
            share = float(number)
        except ValueError:
            share = math.nan
        if not 0 <= share <= 1:
            raise click.UsageError(
                f"--hidden-share {word}: expected [ROOM=]SHARE with a share from 0 to 1, such as "
                "0.4 or kitchen=0.2"
            )
        if shares.setdefault(room, share) != share:
            of = f"of {room}" if room else "of all rooms"
            raise click.UsageError(
                f"--hidden-share says {shares[room]:g} and {share:g} {of}; give one of them"
            )
    every = shares.pop("", None)
    return {"every": every, "rooms": shares}


def _encode_room(room: bsg_models.RoomBelief) -> dict[str, Any]:
    unseen = [
        {"class": c.name, "presence": round(c.probability, 4), "expected": round(c.expected, 4)}
        for c in room.unseen
    ]
    return {**room._asdict(), "expected_more": round(room.expected_more, 3), "unseen": unseen}


def _print_rooms(report: bsg_models.BeliefReport) -> None:
    """Print what is believed of each room as a table, and how much there is in all."""
    rows = []
    for room in report.rooms[:_MOST_ROWS]:
        unseen = ", ".join(f"{c.name} {round(c.probability, 4):.0%}" for c in room.unseen)
        more = f"{room.expected_more:.1f}"
        rows.append((room.scene_id, room.room, room.seen, more, unseen or "nothing"))
    header = ("building", "room", "seen", "expected more", "unseen, most expected first")
    print_text(format_text(rows, header=header))
    if len(report.rooms) > _MOST_ROWS:
        print_note(f"… and {len(report.rooms) - _MOST_ROWS:,} more rooms; --json prints all")
    graphs = "1 belief graph" if report.number == 1 else f"{report.number:,} belief graphs"
    print_text(f"{graphs}, {report.blind:,} blind nodes, by {report.model}")
