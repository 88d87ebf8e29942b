"""Draw the figures of docs/concepts.md, each from what the program computes.

    python scripts/figures/concepts.py --out docs/figures

The same versions of the dependencies give the same bytes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import click
import matplotlib as mpl
import networkx as nx
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from bsg_data import (
    MaskRecipe,
    SceneGraph,
    build_dataset,
    open_source,
    read_manifest,
    read_scene_graphs,
    write_synthetic,
)
from bsg_data.extend import WithLayouts
from bsg_data.scene.class_space import ClassSpace
from bsg_models import Predictor, mask_scene
from bsg_models.belief.hidden_share import ShareBelief
from bsg_robot import SeenBuilding, open_graph, read_robot_graph
from bsg_robot.graph.reports import hide_of_room

HOME = Path(__file__).resolve().parents[2] / "docs" / "home.json"
STEPS = (
    ("annotations", "names of the objects\nin each room"),
    ("scene graph", "building, rooms,\nobjects"),
    ("shards", "the same as\nparquet tables"),
    ("pairs", "what is left when\nobjects are hidden,\nand what is there"),
    ("model", "learns what rooms\nhide"),
    ("expectation", "how many of each\nclass are hidden,\nand how likely"),
    ("belief graph", "the partial graph\nwith blind nodes"),
    ("search", "where to look first"),
)
Floats = npt.NDArray[np.float64]
BLUE, ORANGE, GREY, LIGHT = "#3f51b5", "#e8710a", "#9aa0a6", "#e8eaf6"
THING = "bed"


def draw_pipeline() -> Figure:
    """Draw the steps from annotations to search."""
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    axes = figure.subplots()
    for place, (name, what) in enumerate(STEPS):
        x, y = place % 4 * 2.7, -(place // 4) * 1.65
        box = {"boxstyle": "round,pad=0.25", "fc": LIGHT, "ec": BLUE}
        axes.text(x, y + 0.34, name, ha="center", va="center", weight="bold", color=BLUE)
        axes.text(x, y - 0.2, what, ha="center", va="center", size=9)
        axes.add_patch(mpl.patches.FancyBboxPatch((x - 0.9, y - 0.4), 1.8, 0.8, **box, zorder=-1))
        if place % 4 < 3:
            _point(axes, (x + 1.2, y), (x + 1.5, y))
    axes.text(9.45, -0.82, "↵", ha="center", va="center", size=16, color=BLUE)
    axes.set(xlim=(-1.3, 9.7), ylim=(-2.4, 0.75), aspect="equal")
    axes.axis("off")
    return figure


def draw_masks() -> Figure:
    """Draw what two masks leave of one building: a dot for each object, anywhere in its room."""
    graph, space = _make_building()
    spots = _scatter_objects(graph)
    panels = [("what is there", None)]
    panels += [
        (f"what {name} leaves", MaskRecipe(strategy=name)) for name in ("uniform", "explore")
    ]
    figure = Figure(figsize=(11, 3), layout="constrained")
    for axes, (title, recipe) in zip(figure.subplots(1, 3), panels, strict=True):
        left = None if recipe is None else mask_scene(graph, recipe, draw=3, class_space=space)
        seen = {obj.name for obj in left.objects} if left else None
        for room in graph.rooms:
            known = left.rooms[room.room_index - 1] if left else None
            outline = np.reshape(room.footprint or (), (-1, 2))
            dark = known is not None and not known.visited
            axes.fill(*outline.T, fc="#d0d3da" if dark else "#ffffff", ec="#5f6368", lw=1)
            if known is not None:
                told = f"{known.hidden_share:.0%} hidden"
                box = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85}
                axes.text(*outline.mean(axis=0), told, ha="center", va="center", size=8, bbox=box)
        for name, spot in spots.items():
            face, edge = (BLUE, BLUE) if seen is None or name in seen else ("none", ORANGE)
            axes.plot(*spot, "o", ms=3.5, mfc=face, mec=edge, mew=0.8)
        axes.set_title(title, size=11)
        axes.set_aspect("equal")
        axes.axis("off")
    return figure


def _scatter_objects(graph: SceneGraph) -> dict[str, Floats]:
    """Return a random place (x, y) in its room for every object of a class, by its name."""
    rng, spots = np.random.default_rng(0), {}
    for room in graph.rooms:
        low, high = np.reshape(room.footprint or (), (-1, 2))[[0, 2]]
        for obj in graph.objects:
            if obj.room_index == room.room_index and obj.class_index is not None:
                spots[str(obj.instance_id)] = low + rng.uniform(0.05, 0.95, 2) * (high - low)
    return spots


def draw_counts() -> Figure:
    """Draw P(k are hidden) of two classes, in a kitchen that is half seen and one not entered."""
    graph, predictor = read_robot_graph(HOME), Predictor()
    kitchen = 3
    shares = (("not entered", 1.0), ("half of it seen, none seen", 0.5))
    classes = ("chair", "microwave")
    figure = Figure(figsize=(9, 3), layout="constrained")
    for axes, name in zip(figure.subplots(1, 2, sharey=True), classes, strict=True):
        column = predictor.classes.index(name)
        for place, (label, share) in enumerate(shares):
            told = hide_of_room(graph, kitchen, ShareBelief(share))
            answer = predictor(told).hidden_counts.take(np.array([kitchen]))
            counts = np.arange(7)
            odds = [
                np.exp(answer.log_probability(np.full((1, len(predictor.classes)), k)))[0, column]
                for k in counts.astype(float)
            ]
            presence = answer.presence[0, column]
            axes.bar(
                counts + 0.4 * place - 0.2,
                odds,
                0.38,
                color=(BLUE, ORANGE)[place],
                label=f"{label}: presence {presence:.0%}",
            )
        axes.set(title=f"{name}s hidden in a kitchen", xlabel="number k", xticks=counts)
        axes.legend(frameon=False, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("P(exactly k)")
    return figure


def draw_planners() -> Figure:
    """Draw where two planners go for one thing, in the order in which rooms are searched."""
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    for axes, planner in zip(figure.subplots(1, 2), ("nearest", "expected-cost"), strict=True):
        seen = open_graph(HOME)
        odds = {place.room: place.probability for place in seen.where(THING)}
        spots = {room.name: (room.position or (0, 0, 0))[:2] for room in seen.graph.rooms}
        for one, two in seen.graph.adjacency:
            ends = [spots[seen.rooms[number - 1]] for number in (one, two)]
            axes.plot(*zip(*ends, strict=True), "-", color=GREY, lw=1, zorder=0)
        for room, (x, y) in spots.items():
            axes.plot(x, y, "o", ms=34, color=mpl.colormaps["Blues"](0.1 + 0.8 * odds[room]))
            axes.text(x, y, f"{odds[room]:.0%}", ha="center", va="center", size=9)
            axes.text(x + 0.6, y + 0.5, room, size=9)
        route, length = _search(seen, planner)
        connections = nx.Graph(
            [(seen.rooms[one - 1], seen.rooms[two - 1]) for one, two in seen.graph.adjacency]
        )
        for step, (one, two) in enumerate(pairwise(route), 1):
            for start, end in pairwise(nx.shortest_path(connections, one, two)):
                _draw_step(axes, step, np.array(spots[start]), np.array(spots[end]))
        axes.set_title(f"{planner} finds the {THING} after {length:.1f} m", size=11)
        axes.set(xlim=(-1.3, 10.3), ylim=(-1, 6.3), aspect="equal")
        axes.axis("off")
    return figure


def _draw_step(axes: Any, step: int, start: Floats, end: Floats) -> None:
    """Draw an arrow and its number on the right of the way, so that the way back is beside it."""
    ahead = (end - start) / np.linalg.norm(end - start)
    right = np.array([ahead[1], -ahead[0]])
    _point(axes, start + 0.12 * right, end + 0.12 * right, shrink=19)
    place = (start + end) / 2 + 0.4 * right
    style = {"color": ORANGE, "weight": "bold", "ha": "center", "va": "center"}
    axes.text(*place, str(step), **style)


def _search(seen: SeenBuilding, planner: str) -> tuple[list[str], float]:
    """Return the rooms that are gone to until the thing is found upstairs, and how far that is."""
    route, length = ["living"], 0.0
    seen.searched("living")
    while route[-1] != "upstairs":
        costs = {place.room: place.cost for place in seen.where(THING, here=route[-1])}
        room = seen.next_room(THING, here=route[-1], planner=planner)
        assert room is not None
        length += costs[room] or 0.0
        route.append(room)
        seen.searched(room)
    return route, length


def _make_building() -> tuple[SceneGraph, ClassSpace]:
    """Return a synthetic building of six rooms with places, and its class space."""
    with tempfile.TemporaryDirectory() as name:
        folder, dataset = Path(name, "buildings"), Path(name, "dataset")
        list(write_synthetic(folder, scenes=4, seed=5))
        build_dataset(WithLayouts(open_source("hm3d", folder), folder / "layouts"), dataset)
        graphs = (graph for graph in read_scene_graphs(dataset) if len(graph.rooms) == 6)
        return next(graphs), read_manifest(dataset).class_space


def _point(
    axes: Any, start: Sequence[float] | Floats, end: Sequence[float] | Floats, *, shrink: float = 0
) -> None:
    """Draw an arrow between two points."""
    style = {"arrowstyle": "-|>", "color": ORANGE if shrink else BLUE, "lw": 1.6}
    axes.annotate("", end, start, arrowprops={**style, "shrinkA": shrink, "shrinkB": shrink})


FIGURES: dict[str, Callable[[], Figure]] = {
    "pipeline.svg": draw_pipeline,
    "masks.svg": draw_masks,
    "counts.svg": draw_counts,
    "planners.svg": draw_planners,
}


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, help="Folder of the figures."
)
def main(out: Path) -> None:
    """Draw all figures."""
    out.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "belief-scene-graphs"}):  # else ids in an SVG are random
        for name, draw in FIGURES.items():
            draw().savefig(out / name, metadata={"Date": None})


if __name__ == "__main__":
    main()
