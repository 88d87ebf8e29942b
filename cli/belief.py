"""`bsg-belief`: what a trained model believes about a partial scene graph."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np
import numpy.typing as npt

from bsg_cli.data import FRACTION
from bsg_cli.terminal import (
    Command,
    force_option,
    format_table,
    json_option,
    print_json,
    print_note,
    progress_bar,
)
from bsg_data.dataset.histograms import Counts
from bsg_data.errors import BSGError, DatasetError
from bsg_data.observation.partial_graph import PartialGraph, mask_dataset
from bsg_data.observation.robot_json import list_unmapped, read_robot_graph
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.belief_graph import BeliefGraph, Mode, believe, rank_unseen
from bsg_models.belief.formats import choose_format, write_beliefs
from bsg_models.belief.hydra import read_hydra, write_hydra
from bsg_models.belief.tables import write_tables
from bsg_models.inputs.graphs import open_dataset
from bsg_models.rendering.explorer import View, write_explorer
from bsg_models.runs.predictor import Predictor

MOST_ROWS = 60


@click.command(cls=Command)
@click.argument("graphs", type=click.Path(path_type=Path), nargs=-1, metavar="[GRAPH]...")
@click.option("--run", type=click.Path(path_type=Path), required=True, help="Of a trained model.")
@click.option(
    "--data", type=click.Path(path_type=Path), help="Mask buildings of a dataset instead."
)
@click.option(
    "--split",
    type=click.Choice(["train", "val", "test"]),
    default="val",
    show_default=True,
    help="With --data: whose buildings.",
)
@click.option("--fold", type=click.IntRange(min=0), help="With --data of folds: the fold.")
@click.option("--scene", help="With --data: this building alone.")
@click.option(
    "--mask",
    type=click.Choice(["uniform", "rooms", "frontier"]),
    default="uniform",
    show_default=True,
    help="With --data: how objects are hidden.",
)
@click.option(
    "--fraction",
    type=FRACTION,
    default=0.5,
    show_default=True,
    help="With --data: share of the objects to hide.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="With --data: of masks.",
)
@click.option("--labels", help="Label space of a Hydra graph: ade20k or mpcat40.")
@click.option(
    "--mode",
    type=click.Choice(["complete", "unseen"]),
    default="complete",
    show_default=True,
    help="Which blind nodes: as many as are expected, or the top unseen classes.",
)
@click.option(
    "--top", type=click.IntRange(min=1), default=3, show_default=True, help="Unseen classes a room."
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Write belief graphs; the suffix names the format: .json, .tables, .dsg.json, .html.",
)
@click.option("--hydra", type=click.Path(path_type=Path), help="Write one as Spark-DSG JSON.")
@click.option("--tables", type=click.Path(path_type=Path), help="Write all as parquet, a folder.")
@click.option("--html", type=click.Path(path_type=Path), help="Write the explorer, one page.")
@force_option
@json_option
def main(
    graphs: tuple[Path, ...],
    run: Path,
    data: Path | None,
    split: Literal["train", "val", "test"],
    fold: int | None,
    scene: str | None,
    mask: str,
    fraction: float,
    seed: int,
    labels: str | None,
    mode: Mode,
    top: int,
    out: Path | None,
    hydra: Path | None,
    tables: Path | None,
    html: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Say what is expected in every room that was not seen there.

    A GRAPH is a robot's partial scene graph: our JSON (docs/belief.md), or Spark-DSG's.

    \b
    Example:
      bsg-belief graph.json --run run --out belief.json --html belief.html
      bsg-belief --data dataset --split val --run run --tables beliefs
    """
    if bool(graphs) == (data is not None):
        raise click.UsageError("give GRAPHs, or --data DATASET")
    results = [path for path in (out, hydra, tables, html) if path is not None]
    if len({path.absolute() for path in (*results, *graphs)}) < len(results) + len(graphs):
        raise click.UsageError("one file is named twice")
    for path in results:
        if path.exists() and not force:
            raise DatasetError(f"{path}: is there already; --force replaces it")
    out_holds_one = out is not None and not choose_format(out).many
    predictor = Predictor(run)
    if data is None:
        seen: Iterable[tuple[PartialGraph, Counts | None]]
        seen = [(_read(path, labels), None) for path in graphs]
        total = len(graphs)
    else:
        recipe = MaskRecipe.model_validate({"strategy": mask, "fraction": fraction, "seed": seed})
        wanted = _choose(data, split, fold, scene)
        total, seen = len(wanted), mask_dataset(data, wanted, recipe)
    if (out_holds_one or hydra) and total != 1:
        raise click.UsageError(f"--out and --hydra take one graph, not {total}; --tables takes all")
    views: list[View] = []
    answers: list[dict[str, Any]] = []
    with progress_bar("belief", unit="graph") as report:
        for done, (graph, truth) in enumerate(seen, 1):
            expectation = predictor(graph)
            belief = believe(graph, expectation, mode=mode, top=top, model=predictor.name)
            views.append(View(belief, truth))
            answers += _answer(belief, rank_unseen(expectation, top))
            report(done, total)
    if out:
        write_beliefs([view.belief for view in views], out)
    if hydra:
        write_hydra(views[0].belief, hydra)
    if tables:
        write_tables((view.belief for view in views), tables)
    if html:
        write_explorer(views, html)
    if as_json:
        print_json(answers)
        return
    rows = [_row(answer) for answer in answers[:MOST_ROWS]]
    header = ("building", "room", "seen", "expected more", "unseen, most expected first")
    click.echo(format_table(rows, header=header))
    if len(answers) > MOST_ROWS:
        print_note(f"… and {len(answers) - MOST_ROWS:,} more rooms; --json prints all")
    blind = sum(len(view.belief.blind) for view in views)
    graphs_are = "1 belief graph" if len(views) == 1 else f"{len(views):,} belief graphs"
    click.echo(f"{graphs_are}, {blind:,} blind nodes, by {predictor.name}")


def _read(path: Path, labels: str | None) -> PartialGraph:
    """Read a graph of either kind, and say which names the class map does not know."""
    try:
        said = {} if path.suffix == ".sparkdsg" else json.loads(path.read_bytes())
    except OSError as error:
        raise BSGError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise BSGError(f"{path}: no JSON ({error})") from error
    spark = path.suffix == ".sparkdsg" or "SPARK_DSG_header" in said
    if labels is not None and not spark:
        raise click.UsageError(f"--labels is for Hydra's graphs, and {path} is none")
    graph = read_hydra(path, labels=labels) if spark else read_robot_graph(path)
    unmapped = list_unmapped(graph)
    if unmapped:
        names = ", ".join(f"{name!r} ({times})" for name, times in sorted(unmapped.items())[:10])
        print_note(f"{path}: {len(unmapped)} names are not in the class map: {names}")
    return graph


def _choose(
    data: Path, split: Literal["train", "val", "test"], fold: int | None, scene: str | None
) -> frozenset[str]:
    """Return the scenes of a dataset that are asked for."""
    opened = open_dataset(data)
    if scene is not None:
        if scene not in opened.cells:
            raise DatasetError(f"{data}: has no scene {scene!r}")
        return frozenset([scene])
    return frozenset(opened.scenes_of(split, fold=fold))


def _answer(belief: BeliefGraph, ranked: list[npt.NDArray[np.int64]]) -> Iterator[dict[str, Any]]:
    """Yield what is believed of every room, ready for JSON."""
    partial, classes = belief.partial, belief.partial.class_map.classes
    inputs = belief.inputs
    hidden = belief.expected - inputs
    for number, room in enumerate(partial.rooms, 1):
        yield {
            "scene_id": partial.scene_id,
            "room": room.label or room.name,
            "seen": int(inputs[number].sum()),
            "expected_more": round(float(hidden[number].sum()), 3),
            "unseen": [
                {
                    "class": classes[c],
                    "presence": round(float(belief.presence[number, c]), 4),
                    "expected": round(float(hidden[number, c]), 4),
                }
                for c in ranked[number]
            ],
        }


def _row(answer: dict[str, Any]) -> tuple[object, ...]:
    words = ", ".join(f"{one['class']} {one['presence']:.0%}" for one in answer["unseen"])
    more = f"{answer['expected_more']:.1f}"
    return answer["scene_id"], answer["room"], answer["seen"], more, words or "nothing"
