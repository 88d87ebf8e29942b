"""Draw a search as an animation: one frame per room, two robots side by side.

All frames share one palette, which keeps the file small. The same replay gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke
from PIL import Image

from bsg_data.errors import RecipeError
from bsg_data.figure_file import PLAIN_TEXT
from bsg_data.files import write_bytes
from bsg_models.rendering.plan import PlannedRoom
from bsg_models.rendering.replay import Replay, Stop, Walk, describe_share

FORMATS = {".gif": "GIF", ".png": "PNG"}
FRAME_MS, LAST_MS = 1200, 5000  # milliseconds that a frame and the last frame are shown
_WIDTH, _DPI = 10.0, 120  # inches
_HEAD, _FOOT = 1.15, 1.12  # inches above and below the plans
_COLOURS = 128
# the colours of theme.css, light
_INK, _SOFT, _WALL, _PAPER = "#1d2330", "#566074", "#cf8dfd", "#ffffff"
_LIKELY, _ENTERED, _HOLDS = "#a876de", "#eceef3", "#ff0000"
_LEGEND = (
    "Shade and %: probability that a room holds one. Red outline: holds one, which no robot knows.",
    "Grey: entered. Numbers: the order of the rooms entered. Dotted: the next room.",
)


def require_suffix(path: Path) -> None:
    """Refuse a path whose format cannot hold an animation.

    Raises:
        RecipeError: if the suffix is not one of `FORMATS`.
    """
    if path.suffix.lower() not in FORMATS:
        raise RecipeError(f"{path}: expected a name that ends in {' or '.join(FORMATS)}")


def write_animation(replay: Replay, path: Path) -> None:
    """Write a search as an animation. A failed write leaves no partial file.

    Args:
        replay: the search.
        path: file to write, `.gif` or `.png` (an animated PNG).

    Raises:
        RecipeError: if the format cannot hold an animation.
    """
    require_suffix(path)
    first, *others = share_palette([draw_frame(replay, k) for k in range(replay.steps + 1)])
    times = [FRAME_MS] * len(others) + [LAST_MS]
    buffer = io.BytesIO()
    first.save(
        buffer,
        format=FORMATS[path.suffix.lower()],
        save_all=True,
        append_images=others,
        duration=times,
        loop=0,
        optimize=False,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, buffer.getvalue())


def share_palette(frames: Sequence[Image.Image]) -> list[Image.Image]:
    """Return the frames in one palette that serves all of them."""
    width, height = frames[0].size
    strip = Image.new("RGB", (width, height * len(frames)))
    for k, frame in enumerate(frames):
        strip.paste(frame, (0, k * height))
    palette = strip.quantize(_COLOURS, dither=Image.Dither.NONE)
    return [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]


@rc_context(PLAIN_TEXT)
def draw_frame(replay: Replay, step: int) -> Image.Image:
    """Return the picture after `step` rooms; a robot that is done stays in its last room."""
    plan = replay.plan
    wide = _WIDTH / len(replay.walks)
    deep = min(max(wide * plan.height / max(plan.width, 1e-9), 2.0), 0.9 * wide)
    height = _HEAD + deep + _FOOT
    figure = Figure(figsize=(_WIDTH, height), dpi=_DPI, facecolor=_PAPER)
    canvas = FigureCanvasAgg(figure)
    sought = " and ".join(replay.artifacts)
    title = f"Two robots look for: {sought}" if len(replay.walks) > 1 else f"Looking for: {sought}"
    figure.text(0.012, 1 - 0.32 / height, title, size=15, weight="bold", color=_INK)
    figure.text(
        0.988, 1 - 0.32 / height, f"room {step} of {replay.steps}", size=13, color=_SOFT, ha="right"
    )
    for k, walk in enumerate(replay.walks):
        left = k / len(replay.walks)
        stops = walk.stops[: step + 1]
        _write_head(figure, replay, walk, stops, x=left + 0.012, height=height)
        axes = figure.add_axes(
            (left + 0.012, _FOOT / height, 1 / len(replay.walks) - 0.024, deep / height)
        )
        _draw_plan(axes, replay, stops)
    for k, line in enumerate((_describe_all(replay), *reversed(_LEGEND))):
        figure.text(0.012, (0.11 + 0.21 * k) / height, line, size=9, color=_SOFT)
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    return Image.fromarray(pixels).convert("RGB")


def _write_head(
    figure: Figure, replay: Replay, walk: Walk, stops: Sequence[Stop], *, x: float, height: float
) -> None:
    here = stops[-1]
    name = walk.planner + (f", beliefs of {walk.model}" if walk.model else ", no belief")
    state = ", done" if here.target is None else ""
    done = f"{replay.describe_cost(here.cost)} travelled, {len(stops) - 1} rooms entered{state}"
    figure.text(x, 1 - 0.68 / height, name, size=13, weight="bold", color=_INK)
    figure.text(x, 1 - 0.95 / height, done, size=12, color=_INK)
    saw = ", ".join(f"{count} {name}" for name, count in here.seen[:4]) or "no object of a class"
    line = f"in {replay.plan.find(here.room).name}: {saw}"
    figure.text(x, (_FOOT - 0.27) / height, _cut(line, 68), size=9.5, color=_SOFT)


def _draw_plan(axes: Axes, replay: Replay, stops: Sequence[Stop]) -> None:
    plan, here = replay.plan, stops[-1]
    axes.set_axis_off()
    axes.set_xlim(-0.3, plan.width + 0.3)
    axes.set_ylim(plan.height + 0.3, -0.3)
    axes.set_aspect("equal", anchor="N")
    entered = {stop.room for stop in stops}
    for room in plan.rooms:
        likely = None if here.presence is None else here.presence[room.number - 1]
        _draw_room(
            axes, room, likely, entered=room.number in entered, holds=room.number in replay.holds
        )
    for caption, (x, y) in plan.captions:
        axes.text(x, y, caption, size=9, color=_SOFT, va="center")
    _draw_way(axes, replay, stops)


def _draw_room(
    axes: Axes, room: PlannedRoom, likely: float | None, *, entered: bool, holds: bool
) -> None:
    """Draw a room with its name and the probability that it holds an artifact."""
    axes.add_patch(Polygon(room.outline, facecolor=_ENTERED if entered else _PAPER))
    if likely and not entered:
        axes.add_patch(Polygon(room.outline, facecolor=_LIKELY, alpha=likely))
    edge, width = (_HOLDS, 2.6) if holds else (_WALL, 1.2)
    axes.add_patch(Polygon(room.outline, fill=False, edgecolor=edge, linewidth=width))
    (left, top), (right, bottom) = axes.transData.transform(
        ((room.name_x, room.top), (room.right, room.bottom))
    )
    name = _cut_name(room.name, int((right - left - 6) / 8))
    lines = [name] if len(name) > 2 or name == room.name else []
    if likely is not None and not entered:
        lines.append(describe_share(likely))
    if lines and top - bottom > 15 * len(lines) and right - left > 22:
        text = axes.annotate(
            "\n".join(lines),
            (room.name_x, room.top),
            (3, -3),
            textcoords="offset points",
            va="top",
            size=9,
            linespacing=1.05,
            color=_SOFT if entered else _INK,
            zorder=4,
        )
        text.set_path_effects([withStroke(linewidth=2, foreground=_PAPER, alpha=0.7)])


def _draw_way(axes: Axes, replay: Replay, stops: Sequence[Stop]) -> None:
    """Draw the numbered route of a robot and the next room."""
    find = replay.plan.find
    way = [stops[0].room, *(room for stop in stops[1:] for room in stop.way)]
    for a, b in pairwise(map(find, way)):
        (x, y), (to_x, to_y) = a.centre, b.centre
        alpha = 1.0 if a.part == b.part else 0.3  # stairs
        axes.plot([x, to_x], [y, to_y], color=_INK, linewidth=1.8, alpha=alpha)
    here = stops[-1]
    if here.target is not None:
        (x, y), (to_x, to_y) = find(here.room).centre, find(here.target).centre
        axes.plot([x, to_x], [y, to_y], color=_INK, linewidth=1.4, linestyle=(0, (2, 2)))
        axes.plot(to_x, to_y, "o", markersize=7, color=_PAPER, markeredgecolor=_INK)
    for number, stop in enumerate(stops):
        x, y = find(stop.room).centre
        now = stop is here
        colour = _HOLDS if stop.found else _INK
        axes.plot(x, y, "o", markersize=17 if now else 13, color=colour, markeredgecolor=_PAPER)
        axes.text(
            x,
            y,
            str(number),
            size=9 if now else 7.5,
            color=_PAPER,
            ha="center",
            va="center_baseline",
            weight="bold",
        )


def _describe_all(replay: Replay) -> str:
    """Return the result of all searches of the study in one line."""
    told = "; ".join(
        f"{walk.planner} {replay.describe_cost(walk.mean_cost)}" for walk in replay.walks
    )
    saved = f"; {replay.mean_saved} saved" if len(replay.walks) > 1 else ""
    return f"Mean of all {replay.searches:,} searches: {told}{saved}."


def _cut_name(name: str, letters: int) -> str:
    """Cut a name but keep a number at its end, which distinguishes rooms of one name."""
    head, _, number = name.rpartition(" ")
    if len(name) <= letters or not number.isdecimal():
        return _cut(name, letters)
    return f"{_cut(head, letters - len(number) - 1)} {number}"


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: max(0, most - 1)].rstrip() + "…"
