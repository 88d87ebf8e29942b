"""`bsg-belief`: say what a trained model expects in a partial graph."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

import bsg_data
import bsg_models
from bsg_cli.find import find_things
from bsg_cli.options import (
    PATH,
    PagePath,
    data_option,
    force_option,
    json_option,
    mask_options,
    model_option,
    out_option,
    seed_option,
    split_option,
)
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data.result_folder import Place, require_vacant
from bsg_data.seals import refuse_sealed_file
from bsg_data.spelling import SHOWN
from bsg_data.tables import format_text

MOST_ROWS = 60
MOST_NAMES = 10
MOST_CLASSLESS = 3  # names in the note on objects without a class
CHECKED_FIRST = 1_000_000  # bytes of a graph; a larger one takes long to read twice


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
@click.option(
    "--mode",
    type=click.Choice(["complete", "unseen"]),
    default="complete",
    show_default=True,
    help="Blind nodes to add: as many as expected, or one for each top unseen class.",
)
@click.option(
    "--top",
    type=click.IntRange(min=1),
    default=3,
    show_default=True,
    help="Number of unseen classes per room.",
)
@out_option(
    "Write the belief graphs. The suffix sets the format: .json, .tables, .dsg.json or .html."
)
@click.option(
    "--hydra",
    type=PATH,
    help="Write one graph as Spark-DSG JSON. A graph of Hydra keeps all that it had.",
)
@click.option("--tables", type=PATH, help="Write all graphs as a folder of parquet tables.")
@click.option("--html", type=PagePath(), help="Write the explorer, one HTML page.")
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
      bsg-belief dsg.json --labels mpcat40 --hydra annotated.json
      bsg-belief graph.json --model run --out belief.json --html belief.html
      bsg-belief --data dataset --split val --model run --tables beliefs
    """
    if bool(options["graphs"]) == (dataset is not None):
        raise click.UsageError("expected either GRAPHs or --data DATASET; give one of them")
    if here is not None and not find:
        raise click.UsageError("--from needs --find THING; give both or neither")
    require_files(options["graphs"])
    named = options.pop("model")
    if named is not None:
        options["run"] = named
    options |= read_shares(options.pop("shares"), dataset)
    if find:
        seen = open_seen(options, here=here)
        find_things(seen, tuple(dict.fromkeys(find)), here=here, as_json=as_json)
        return
    refuse_present(options)
    check_graphs(options)
    request = read_request(dataset, options)
    with progress_bar("belief", unit="graph") as progress:
        report = bsg_models.report_beliefs(request, progress=progress)
    note_model(options)
    for path, names in report.unmapped.items():
        note_unmapped(path, names)
    for path, rules in report.resolved.items():
        made = ", ".join(f"{r.name!r} is {r.category!r} ({r.rule})" for r in rules[:MOST_NAMES])
        more = f", and {len(rules) - MOST_NAMES:,} more" if len(rules) > MOST_NAMES else ""
        print_note(f"{path}: names read by rule, for they are not in the class map: {made}{more}")
    for path, source in report.unknown_sources.items():
        known = ", ".join(bsg_data.KNOWN_SOURCES)
        print_note(f"{path}: source {source!r} is read as unknown; models know {known}")
    for path, notes in report.notes.items():
        note_reading(path, notes)
    for path, graph in zip(request.graphs, report.graphs, strict=False):
        note_classless(path, graph.partial, model=report.model)
        note_shares(path, graph.partial)
    if as_json:
        print_json([encode_room(room) for room in report.rooms])
        return
    rows = [_row(room) for room in report.rooms[:MOST_ROWS]]
    header = ("building", "room", "seen", "expected more", "unseen, most expected first")
    print_text(format_text(rows, header=header))
    if len(report.rooms) > MOST_ROWS:
        print_note(f"… and {len(report.rooms) - MOST_ROWS:,} more rooms; --json prints all")
    number, held = report.number, len(report.graphs)
    graphs_are = "1 belief graph" if number == 1 else f"{number:,} belief graphs"
    print_text(f"{graphs_are}, {report.blind:,} blind nodes, by {report.model}")
    if request.html and held < number:
        print_note(
            f"{request.html}: shows the first {held:,} of {number:,} graphs; --tables writes all"
        )
    if written := request.results:
        print_text(f"written: {', '.join(map(str, written))}")


def open_seen(options: dict[str, Any], *, here: str | None) -> bsg_models.SeenBuilding:
    """Return the one graph of the options with its model.

    Raises:
        click.UsageError: for several graphs, or an option that `--find` does not use.
    """
    graphs: tuple[Path, ...] = options["graphs"]
    context = click.get_current_context()
    for name in ("mode", "top", "split", "fold", "scene", "force"):
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise click.UsageError(f"--find does not use --{name}; leave one of them out")
    if len(graphs) != 1:
        raise click.UsageError(f"--find: expected one GRAPH, found {len(graphs) or '--data'}")
    written = [name for name in ("out", "hydra", "tables", "html") if options[name]]
    if written:
        raise click.UsageError(f"--find writes no files; leave out --find or --{written[0]}")
    model = options.get("run", bsg_models.DEFAULT_MODEL)
    told = {name: options[name] for name in ("labels", "hidden_share", "hidden_shares")}
    check_graphs(options, here=here)
    seen = bsg_models.open_graph(graphs[0], model=model, **told)
    note_model(options)
    if seen.unmapped:
        note_unmapped(graphs[0], seen.unmapped)
    note_reading(graphs[0], seen.notes)
    note_classless(graphs[0], seen.graph, model=seen.model)
    note_shares(graphs[0], seen.graph)
    return seen


def require_files(graphs: Sequence[Path]) -> None:
    """Refuse a missing graph before the models are imported, which is slow.

    Raises:
        BSGError: naming the first missing graph.
    """
    for path in graphs:
        if str(path) != "-" and not path.exists():
            raise bsg_data.BSGError(f"{path}: cannot be read (No such file or directory)")


def refuse_present(options: dict[str, Any]) -> None:
    """Refuse files that are there already, or of no format, before the models are imported.

    The library refuses what is left: folders, and files beside what a killed command left, which
    it undoes first.

    Raises:
        DatasetError: naming the first such file.
        RecipeError: if no format has the suffix of `--out`.
    """
    if options["out"] is not None:
        from bsg_models.belief.formats import choose_format

        choose_format(options["out"])
    read = {path.absolute() for path in options["graphs"]}  # naming one of them is another error
    for name in ("out", "hydra", "html"):
        path: Path | None = options[name]
        if path is None or options["force"] or path.absolute() in read:
            continue
        if path.is_file() and not Place(path, is_file=True).unfinished.exists():
            refuse_sealed_file(path)
            require_vacant(path)


def check_graphs(options: dict[str, Any], *, here: str | None = None) -> None:
    """Refuse faulty graphs and unknown rooms before the models are imported, which is slow.

    A pipe is read once only, and a large file too.

    Raises:
        BSGError: as `open_graph` raises it.
    """
    for path in options["graphs"]:
        if str(path) == "-" or not path.is_file() or path.stat().st_size > CHECKED_FIRST:
            continue
        graph = bsg_models.read_graph(path, labels=options["labels"])
        told = {"every": options["hidden_share"], "rooms": options["hidden_shares"]}
        bsg_models.tell_shares(graph, **told)
        if here is not None:
            from bsg_models.robot.room_names import find_room

            find_room(graph, here)


def note_model(options: dict[str, Any]) -> None:
    """Print which model was used, if the user named none; call it after the graphs are read."""
    if "run" not in options:
        print_note(f"model: {bsg_models.describe_model()}")


def note_unmapped(path: Path, names: Sequence[bsg_data.UnmappedEntry]) -> None:
    """Print which names of a graph are not in the class map, with the nearest names."""
    what = "1 name is" if len(names) == 1 else f"{len(names):,} names are"
    shown = ", ".join(map(_describe_unmapped, names[:MOST_NAMES]))
    more = f", and {len(names) - MOST_NAMES:,} more" if len(names) > MOST_NAMES else ""
    print_note(f"{path}: {what} not in the class map: {shown}{more}")


def note_classless(path: Path, graph: bsg_data.PartialGraph, *, model: str) -> None:
    """Print how many seen objects have a known name but no class, and which names most often.

    Parts of the building are left out, because models count objects.
    """
    structure = bsg_data.load_class_map().structure
    names = Counter(
        obj.raw_category
        for obj in graph.objects
        if obj.class_index is None and obj.category is not None and obj.category not in structure
    )
    if not names:
        return
    number = names.total()
    most = ", ".join(repr(name[:SHOWN]) for name, _ in names.most_common(MOST_CLASSLESS))
    which = f"most often {most}" if len(names) > MOST_CLASSLESS else most
    what = "1 seen object has" if number == 1 else f"{number:,} seen objects have"
    counted = "is in no count" if number == 1 else "are in no count"
    print_note(f"{path}: {what} no class in {model} and {counted}: {which}")


def note_reading(path: Path, notes: Sequence[str]) -> None:
    """Print the notes of reading a graph."""
    for note in notes:
        print_note(f"{path}: {note}")


def note_shares(path: Path, graph: bsg_data.PartialGraph) -> None:
    """Print which hidden shares of a graph are estimated or not known."""
    unsure: dict[str, list[str]] = {}
    for room in graph.rooms:
        if not room.share.is_certain:
            unsure.setdefault(str(room.share), []).append(room.label or room.name)
    for share, rooms in unsure.items():
        more = f" and {len(rooms) - MOST_NAMES:,} more" if len(rooms) > MOST_NAMES else ""
        print_note(
            f"{path}: the hidden share is uncertain in {', '.join(rooms[:MOST_NAMES])}{more}: "
            f"assumed {share}; give floor_in_view in the graph, or --hidden-share, to be exact"
        )


def read_request(dataset: Path | None, options: dict[str, Any]) -> bsg_models.BeliefRequest:
    """Return the request of the options; the options of masks count only with a dataset."""
    mask = {"strategy": options.pop("mask")}
    mask |= {name: options.pop(name) for name in ("fraction", "seed", "withhold", "parts")}
    scenes = {name: options.pop(name) for name in ("split", "fold", "scene")}
    if dataset is None:
        return bsg_models.BeliefRequest(**options)
    scenes |= {"dataset": dataset, "mask": mask}
    return bsg_models.BeliefRequest.model_validate({**options, "scenes": scenes})


def read_shares(said: Sequence[str], dataset: Path | None) -> dict[str, Any]:
    """Return the hidden shares of `--hidden-share`: `0.4` for all rooms, `kitchen=0.2` for one."""
    if said and dataset is not None:
        raise click.UsageError("--hidden-share needs GRAPHs; with --data give --mask instead")
    told: dict[str, float] = {}  # by room; the empty name stands for all other rooms
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
        if told.setdefault(room, share) != share:
            of = f"of {room}" if room else "of all rooms"
            raise click.UsageError(
                f"--hidden-share says {told[room]:g} and {share:g} {of}; give one of them"
            )
    every = told.pop("", None)
    return {"hidden_share": every, "hidden_shares": told}


def encode_room(room: bsg_models.RoomBelief) -> dict[str, Any]:
    """Return the belief of a room, ready for JSON."""
    unseen = [
        {"class": one.name, "presence": one.presence, "expected": one.expected}
        for one in room.unseen
    ]
    return {**room._asdict(), "unseen": unseen}


def _describe_unmapped(name: bsg_data.UnmappedEntry) -> str:
    near = f"; nearest: {', '.join(name.nearest)}" if name.nearest else ""
    return f"{name.name[:SHOWN]!r} ({name.instances:,}{near})"


def _row(room: bsg_models.RoomBelief) -> tuple[object, ...]:
    unseen = ", ".join(f"{one.name} {one.presence:.0%}" for one in room.unseen)
    return room.scene_id, room.room, room.seen, f"{room.expected_more:.1f}", unseen or "nothing"
