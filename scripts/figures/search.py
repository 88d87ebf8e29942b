"""Draw one search of a study as an animation: one frame a room, two robots side by side.

    python scripts/figures/search.py demo/dataset --scene 00017-sta13NdfxpY --out search.png

It shows the search that `bsg-search --trace` shows in the same study. The suffix is the format,
`.png` or `.gif`. All frames share one palette, which keeps the file small. The same study gives the
same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import click
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from PIL import Image

from bsg_data import Dataset
from bsg_data.files import PLAIN_TEXT
from bsg_models import study_search
from bsg_models.rendering.plan import PlannedRoom
from bsg_models.rendering.replay import Replay, Visit, Walk
from bsg_models.runs.found_model import locate_run
from bsg_models.studies.replay import replay_search
from bsg_models.studies.savings import summarise
from bsg_models.studies.search_request import SearchRequest, choose_buildings

FRAME_MS, LAST_MS = 1200, 5000  # milliseconds that a frame and the last frame are shown
_WIDTH, _DPI = 10.0, 120  # inches
_HEAD, _FOOT = 1.15, 1.12  # inches above and below the plans
_MARGIN = 0.012  # of the width
_COLOURS = 128
# the colours of theme.css, light
_INK, _SOFT, _WALL, _PAPER = "#1d2330", "#566074", "#cf8dfd", "#ffffff"
_LIKELY, _ENTERED, _HOLDS = "#a876de", "#eceef3", "#ff0000"
_LEGEND = (
    "Grey: entered. Numbers: the order of the rooms entered. Dotted: the next room.",
    "Shade and %: probability that a room holds one. Red outline: holds one, which no robot knows.",
)


@click.command(help=__doc__, context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option("--scene", required=True, help="The building.")
@click.option("--model", default="universal", show_default=True, help="Of the left robot.")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="The picture.")
def main(dataset: Path, scene: str, model: str, out: Path) -> None:
    """Search the building, and draw one search."""
    draw_replay(run_study(dataset, scene, model), out)


def run_study(dataset: Path, scene: str, model: str) -> Replay:
    """Return a search that is worth watching, of 60 in a building with doors."""
    request = SearchRequest.read(
        dataset,
        runs=(locate_run(model),),
        scene=scene,
        worlds=("layout",),
        artifacts=("room-specific",),
        mask="explore",
        fraction=0.9,
        episodes=60,
        trace="auto",
    )
    data = Dataset.open(dataset)
    runs, _ = choose_buildings(request, data)
    study = study_search(dataset, runs, request)
    results = summarise(study, resamples=request.resamples)
    return replay_search(data, study, results, runs, model=model, trace="auto")


def draw_replay(replay: Replay, path: Path) -> None:
    """Draw a search from its start to its end."""
    frames = [draw_frame(replay, k) for k in range(replay.steps + 1)]
    strip = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames]))
    palette = strip.quantize(_COLOURS, dither=Image.Dither.NONE)
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    first.save(
        path,
        save_all=True,
        append_images=others,
        duration=[FRAME_MS] * len(others) + [LAST_MS],
        loop=0,
        optimize=False,
    )


@rc_context(PLAIN_TEXT)
def draw_frame(replay: Replay, step: int) -> Image.Image:
    """Return the picture after `step` rooms; a robot that is done stays in its last room."""
    plan, share = replay.plan, 1 / len(replay.walks)
    wide = _WIDTH * share
    deep = min(max(wide * plan.height / max(plan.width, 1e-9), 2.0), 0.9 * wide)
    height = _HEAD + deep + _FOOT
    figure = Figure(figsize=(_WIDTH, height), dpi=_DPI, facecolor=_PAPER)
    canvas = FigureCanvasAgg(figure)
    sought = " and ".join(replay.artifacts)
    title = f"Two robots look for: {sought}" if len(replay.walks) > 1 else f"Looking for: {sought}"
    line, right = 1 - 0.32 / height, 1 - _MARGIN
    figure.text(_MARGIN, line, title, size=15, weight="bold", color=_INK)
    shown = f"room {step} of {replay.steps}"
    figure.text(right, line, shown, size=13, color=_SOFT, ha="right")
    for k, walk in enumerate(replay.walks):
        stops, x = walk.stops[: step + 1], k * share + _MARGIN
        _write_head(figure, replay, walk, stops, x=x, height=height)
        box = (x, _FOOT / height, share - 2 * _MARGIN, deep / height)
        _draw_plan(figure.add_axes(box), replay, stops)
    for k, text in enumerate((_describe_all(replay), *_LEGEND)):
        figure.text(_MARGIN, (0.11 + 0.21 * k) / height, text, size=9, color=_SOFT)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    return Image.fromarray(pixels).convert("RGB")


def _write_head(
    figure: Figure, replay: Replay, walk: Walk, stops: Sequence[Visit], *, x: float, height: float
) -> None:
    here = stops[-1]
    name = walk.planner + (f", beliefs of {walk.model}" if walk.model else ", no belief")
    state = ", done" if here.target is None else ""
    done = f"{replay.describe_cost(here.cost)} travelled, {len(stops) - 1} rooms entered{state}"
    figure.text(x, 1 - 0.68 / height, name, size=13, weight="bold", color=_INK)
    figure.text(x, 1 - 0.95 / height, done, size=12, color=_INK)
    saw = ", ".join(f"{count} × {name}" for name, count in here.seen[:4]) or "no object of a class"
    line = f"saw in {_find(replay, here.room).name}: {saw}"
    figure.text(x, (_FOOT - 0.27) / height, _cut(line, 68), size=9.5, color=_SOFT)


def _draw_plan(axes: Axes, replay: Replay, stops: Sequence[Visit]) -> None:
    plan, presence = replay.plan, stops[-1].presence
    axes.set_axis_off()
    axes.set_xlim(-0.3, plan.width + 0.3)
    axes.set_ylim(plan.height + 0.3, -0.3)
    axes.set_aspect("equal", anchor="N")
    entered = {stop.room for stop in stops}
    for room in plan.rooms:
        is_entered = room.number in entered
        likely = None if presence is None or is_entered else presence[room.number - 1]
        axes.add_patch(Polygon(room.outline, facecolor=_ENTERED if is_entered else _PAPER))
        if likely:
            axes.add_patch(Polygon(room.outline, facecolor=_LIKELY, alpha=likely))
        edge, width = (_HOLDS, 2.6) if room.number in replay.holds else (_WALL, 1.2)
        axes.add_patch(Polygon(room.outline, fill=False, edgecolor=edge, linewidth=width))
        _name_room(axes, room, likely, colour=_SOFT if is_entered else _INK)
    for caption, (x, y) in plan.captions:
        axes.text(x, y, caption, size=9, color=_SOFT, va="center")
    _draw_way(axes, replay, stops)


def _name_room(axes: Axes, room: PlannedRoom, likely: float | None, *, colour: str) -> None:
    """Write the name of a room and the probability that it holds an artifact, if they fit."""
    (left, top), (right, bottom) = axes.transData.transform(
        ((room.name_x, room.top), (room.right, room.bottom))
    )
    name = _cut_name(room.name, int((right - left - 6) / 8))
    lines = [name] if len(name) > 2 or name == room.name else []
    if likely is not None:
        lines.append(_describe_share(likely))
    if lines and top - bottom > 15 * len(lines) and right - left > 22:
        text = axes.annotate(
            "\n".join(lines),
            (room.name_x, room.top),
            (3, -3),
            textcoords="offset points",
            va="top",
            size=9,
            linespacing=1.05,
            color=colour,
            zorder=4,
        )
        text.set_path_effects([withStroke(linewidth=2, foreground=_PAPER, alpha=0.7)])


def _draw_way(axes: Axes, replay: Replay, stops: Sequence[Visit]) -> None:
    """Draw the numbered route of a robot and the next room."""
    here = stops[-1]
    way = [stops[0].room, *(room for stop in stops[1:] for room in stop.way)]
    for a, b in pairwise(_find(replay, number) for number in way):
        (x, y), (to_x, to_y) = _centre(a), _centre(b)
        alpha = 1.0 if a.part == b.part else 0.3  # stairs
        axes.plot([x, to_x], [y, to_y], color=_INK, linewidth=1.8, alpha=alpha)
    if here.target is not None:
        x, y = _centre(_find(replay, here.room))
        to_x, to_y = _centre(_find(replay, here.target))
        axes.plot([x, to_x], [y, to_y], color=_INK, linewidth=1.4, linestyle=(0, (2, 2)))
        axes.plot(to_x, to_y, "o", markersize=7, color=_PAPER, markeredgecolor=_INK)
    for number, stop in enumerate(stops):
        x, y = _centre(_find(replay, stop.room))
        size, letters = (17, 9) if stop is here else (13, 7.5)
        colour = _HOLDS if stop.found else _INK
        axes.plot(x, y, "o", markersize=size, color=colour, markeredgecolor=_PAPER)
        text = axes.text(x, y, str(number), size=letters, color=_PAPER, weight="bold")
        text.set(ha="center", va="center_baseline")


def _find(replay: Replay, number: int) -> PlannedRoom:
    return next(room for room in replay.plan.rooms if room.number == number)


def _centre(room: PlannedRoom) -> tuple[float, float]:
    return (room.left + room.right) / 2, (room.top + room.bottom) / 2


def _describe_all(replay: Replay) -> str:
    """Return the result of all searches of the study in one line."""
    told = "; ".join(
        f"{walk.planner} {replay.describe_cost(walk.mean_cost)}" for walk in replay.walks
    )
    saved = f"; {replay.mean_saved} saved" if len(replay.walks) > 1 else ""
    return f"Mean of all {replay.searches:,} searches: {told}{saved}."


def _describe_share(share: float) -> str:
    """Format a probability in whole per cent; only exact 0 and 1 become 0 % and 100 %."""
    if 0 < share < 0.005:
        return "< 1 %"
    return "> 99 %" if 0.995 < share < 1 else f"{100 * share:.0f} %"


def _cut_name(name: str, letters: int) -> str:
    """Cut a name but keep a number at its end, which distinguishes rooms of one name."""
    head, _, number = name.rpartition(" ")
    if len(name) <= letters or not number.isdecimal():
        return _cut(name, letters)
    return f"{_cut(head, letters - len(number) - 1)} {number}"


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: max(0, most - 1)].rstrip() + "…"


if __name__ == "__main__":
    main()
