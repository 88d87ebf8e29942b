"""`bsg-belief`: say what a trained model expects in a partial graph."""

from __future__ import annotations

import webbrowser
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import bsg_data
import bsg_models
import bsg_robot
from bsg_cli.find import OF_SEARCH, find_things, read_by_room, read_search, search_options
from bsg_cli.options import (
    PATH,
    choice_option,
    force_option,
    json_option,
    mask_options,
    model_option,
    number_option,
    read_now_option,
    refuse_unused,
    room_labels_option,
    split_option,
)
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data.tables import format_text

if TYPE_CHECKING:
    from bsg_robot.answers.belief_report import BeliefReport, RoomBelief
    from bsg_robot.graph.graph_file import GraphFile

_MOST_ROWS = 60
_MANIFEST = "dataset.json"  # in every dataset; the module that defines it is slow to import
_OF_DATASET, _OF_GRAPH = (
    ("split", "scene", "mask", "fraction"),
    ("labels", "room_labels", "now", "shares", "find"),
)
_PAGES = (".html", ".htm")


@click.command("bsg-belief", cls=Command)
@click.argument("paths", type=PATH, nargs=-1, required=True, metavar="GRAPH...|DATASET")
@model_option("A shipped model, a trained run, or a model of the hub.  [default: universal]")
@split_option("Of a DATASET: the split.", default="val")
@click.option("--scene", help="Of a DATASET: only this building.")
@mask_options("Of a DATASET: how to hide objects.", "Of a DATASET: share of the objects to hide.")
@click.option("--labels", metavar="SPACE", help="Label space of Hydra: mpcat40, ade20k, or a file.")
@room_labels_option
@click.option(
    "--now",
    callback=read_now_option,
    metavar="TIME",
    help="What time it is: `now`, ISO 8601 with a zone, or seconds of the graph's clock.  "
    "[default: that of the graph]",
)
@click.option(
    "--hidden-share",
    "shares",
    multiple=True,
    metavar="[ROOM=]SHARE",
    help="Share of a room's objects that the robot has not seen, from 0 (searched) to 1 (not "
    "entered); without ROOM for all other rooms.",
)
@search_options
@choice_option(
    "--mode",
    ["complete", "unseen"],
    "Blind nodes to add: as many as expected, or one for each top unseen class.",
    default="complete",
)
@number_option("--top", "Number of unseen classes per room.", default=3)
@click.option(
    "--out",
    type=PATH,
    multiple=True,
    help="Write the belief graphs; may be repeated. The suffix is the format: .html (page), .json, "
    ".dsg.json (of one graph of Hydra), or that of a package: docs/belief.md has .tables (parquet) "
    "and .rrd (Rerun).",
)
@click.option("--open", "shows", is_flag=True, help="Open the page of --out in the browser.")
@click.option("--quiet", is_flag=True, help="Leave out the notes.")
@force_option
@json_option
def main(paths: tuple[Path, ...], as_json: bool, shows: bool, quiet: bool, **options: Any) -> None:
    """Say which unseen objects a model expects in each room, or where one thing is.

    A GRAPH is a robot's partial graph: our JSON (docs/belief.md) or Spark-DSG JSON; `-` is
    standard input. A DATASET is masked first, so that the page also shows the truth.

    \b
    Example:
      bsg-belief graph.json --find microwave --from hall
      bsg-belief graph.json --find mug --from hall --budget 60 --speed 0.5
      bsg-belief graph.json --out belief.html --open
      bsg-belief graph.json later.json --out beliefs.html
      bsg-belief dsg.json --labels mpcat40 --out annotated.dsg.json
      bsg-belief dataset --split val --model run --out beliefs.html
    """
    dataset = _find_dataset(paths)
    _refuse_mixed(paths, dataset, options)
    pages = [path for path in options["out"] if path.suffix.casefold() in _PAGES]
    if shows and not pages:
        raise click.UsageError("--open shows a page; add --out FILE.html")
    _require_formats(options["out"])
    find, search = options.pop("find"), read_search(options)
    model, labels, own = (options.pop(name) for name in ("model", "labels", "room_labels"))
    shares = _read_shares(options.pop("shares"))
    graphs = () if dataset is not None else paths
    files = [_open_graph(path, labels, own, shares) for path in graphs]
    note = _say_nothing if quiet else print_note
    if model is None:
        model = bsg_models.DEFAULT_MODEL
        from bsg_models.runs.found_model import TERMS

        note(TERMS)
    answer = None
    if find:
        seen = _open_building(files[0], model, search, options["now"], note=note)
        answer = find_things(seen, find, as_json=as_json, note=note, **search)
    if options["out"] or not find:
        from bsg_robot.answers.belief_report import BeliefRequest, report_beliefs

        mask = {"strategy": options.pop("mask"), "fraction": options.pop("fraction")}
        request = BeliefRequest(
            run=model,
            graphs=tuple(files),
            dataset=dataset,
            mask=bsg_data.MaskRecipe.model_validate(mask),
            answer=answer,
            **options,
        )
        with progress_bar("belief", unit="graph") as progress:
            report = report_beliefs(request, progress=progress)
        if not find:
            _print_report(report, files, as_json=as_json, note=note)
        if request.out and not as_json:
            print_text(f"written: {', '.join(_describe_file(path, shows) for path in request.out)}")
    for page in pages if shows else ():
        if not webbrowser.open(page.resolve().as_uri()):
            print_note(f"no browser opens here; open {page} in one")


def _refuse_mixed(paths: Sequence[Path], dataset: Path | None, options: Mapping[str, Any]) -> None:
    """Refuse what is asked of one kind of question, and said of another."""
    find, out, robots = options["find"], options["out"], options["robots"]
    is_placed = robots or options["here"] is not None
    for applies, unused, what in (
        (dataset is not None, _OF_GRAPH, "a DATASET"),
        (dataset is None, _OF_DATASET, "a GRAPH"),
        (not find, OF_SEARCH, "a question without --find"),
        (find and not out, ("mode", "top"), "--find without --out"),
        (not out, ("force",), "a command without --out"),
        (robots, ("here", "out"), "a search by several robots"),
        (not is_placed, ("budget", "speed"), "a search without --from or --robot"),
    ):
        if applies:
            refuse_unused(unused, what)
    if find and len(paths) > 1:
        raise click.UsageError(f"--find: expected one GRAPH, found {' '.join(map(str, paths))}")


def _say_nothing(_: str) -> None:
    """Print no note."""


def _find_dataset(paths: Sequence[Path]) -> Path | None:
    """Return the dataset among the paths; None if all are graphs."""
    for path in paths:
        if str(path) != "-":
            path.stat()  # that there is none comes before what else is wrong
    folders = [path for path in paths if path.is_dir()]
    if not folders:
        return None
    if len(paths) > 1:
        raise click.UsageError(f"expected GRAPHs or one DATASET, found {len(paths)} paths")
    if not (folders[0] / _MANIFEST).is_file():
        raise click.UsageError(
            f"{folders[0]}: expected the file of a GRAPH or the folder of a DATASET, found a "
            f"folder without {_MANIFEST}"
        )
    return folders[0]


def _describe_file(path: Path, shows: bool) -> str:
    """Return a file that was written, and what opens it if that is not obvious."""
    if path.suffix.casefold() in _PAGES and not shows:
        return f"{path} (open it in a browser, or add --open)"
    return str(path)


def _require_formats(paths: Sequence[Path]) -> None:
    """Refuse a suffix of no format before the work starts."""
    for path in paths:
        from bsg_robot.graph.formats import choose_format  # an answer alone does not need it

        choose_format(path)


def _print_report(
    report: BeliefReport,
    files: Sequence[GraphFile],
    *,
    as_json: bool,
    note: Callable[[str], None],
) -> None:
    """Print the notes on the graphs, and what is believed."""
    for file, notes in zip(files, report.notes, strict=False):
        for text in notes:
            note(f"{file.path}: {text}")
    if len(report.graphs) < report.number:
        note(f"a page shows the first {len(report.graphs):,} of {report.number:,} graphs")
    if as_json:
        print_json([_encode_room(room) for room in report.rooms])
    else:
        _print_rooms(report)


def _open_building(
    file: GraphFile,
    model: Path | str,
    search: Mapping[str, Any],
    now: float | None,
    *,
    note: Callable[[str], None],
) -> bsg_robot.SeenBuilding:
    """Return the building of a search, whose rooms and costs are checked before a model is read."""
    # Imported here, as in the next: a help or a typo must not wait for SciPy and torch.
    from bsg_robot.answers.ways import check_costs
    from bsg_robot.answers.words import find_room
    from bsg_robot.graph.reports import reclassify

    for room in filter(None, (search["here"], *search["robots"].values())):
        find_room(file.graph, room)
    check_costs(file.graph, search["costs"])
    predictor = bsg_models.Predictor(model)
    graph = reclassify(file.graph, predictor.class_map)
    seen = bsg_robot.SeenBuilding(graph, predictor, notes=file.notes)
    if now is not None:
        seen.passes(until=now)
    for text in seen.notes:
        note(f"{file.path}: {text}")
    return seen


def _open_graph(
    path: Path, labels: str | None, own: Path | None, shares: dict[str, Any]
) -> GraphFile:
    """Read a robot's graph once, before models are imported, which is slow."""
    from bsg_robot.answers.words import set_hidden_shares
    from bsg_robot.graph.graph_file import open_graph_file

    file = open_graph_file(path, labels=labels, room_labels=own)
    return replace(file, graph=set_hidden_shares(file.graph, **shares))


def _read_shares(words: Sequence[str]) -> dict[str, Any]:
    """Return the hidden shares of `--hidden-share`: `0.4` for all rooms, `kitchen=0.2` for one."""
    shares = read_by_room("--hidden-share", words, "SHARE with a share from 0 to 1", most=1)
    return {"every": shares.pop("", None), "rooms": shares}


def _encode_room(room: RoomBelief) -> dict[str, Any]:
    unseen = [
        {"class": c.name, "presence": round(c.probability, 4), "expected": round(c.expected, 4)}
        for c in room.unseen
    ]
    facts = room._asdict() | {"expected_more": round(room.expected_more, 3), "unseen": unseen}
    return facts | {"kinds": {kind.name: round(kind.probability, 4) for kind in room.kinds}}


def _print_rooms(report: BeliefReport) -> None:
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
