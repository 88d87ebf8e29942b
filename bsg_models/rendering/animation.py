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
from PIL.PngImagePlugin import PngInfo

from bsg_data.errors import RecipeError
from bsg_data.files import PLAIN_TEXT, write_bytes
from bsg_models.rendering.plan import PlannedRoom
from bsg_models.rendering.replay import Replay, Visit, Walk

FRAME_MS, LAST_MS = 1200, 5000  # milliseconds that a frame and the last frame are shown
_FORMATS = {".gif": "GIF", ".png": "PNG"}
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


def require_suffix(path: Path) -> None:
    """Refuse a path whose format cannot hold an animation."""
    if path.suffix.lower() not in _FORMATS:
        raise RecipeError(
            f"{path}: expected a name that ends in {', '.join(_FORMATS)} or .rrd",
            code="suffix-unknown",
            where=path,
        )


def write_animation(replay: Replay, path: Path) -> None:
    """Write a search as `.gif` or animated `.png`. A failed write leaves no partial file."""
    require_suffix(path)
    frames = [draw_frame(replay, k) for k in range(replay.steps + 1)]
    strip = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames]))
    palette = strip.quantize(_COLOURS, dither=Image.Dither.NONE)
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    buffer, made_by = io.BytesIO(), PngInfo()
    made_by.add_text("Creator", "bsg-figure")  # what `--force` may replace says so
    first.save(
        buffer,
        format=_FORMATS[path.suffix.lower()],
        save_all=True,
        append_images=others,
        duration=[FRAME_MS] * len(others) + [LAST_MS],
        loop=0,
        optimize=False,
        pnginfo=made_by,
        comment=b"Creator: bsg-figure",
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, buffer.getvalue())


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
    line = f"saw in {replay.plan.find(here.room).name}: {saw}"
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
    find, here = replay.plan.find, stops[-1]
    way = [stops[0].room, *(room for stop in stops[1:] for room in stop.way)]
    for a, b in pairwise(map(find, way)):
        (x, y), (to_x, to_y) = a.centre, b.centre
        alpha = 1.0 if a.part == b.part else 0.3  # stairs
        axes.plot([x, to_x], [y, to_y], color=_INK, linewidth=1.8, alpha=alpha)
    if here.target is not None:
        (x, y), (to_x, to_y) = find(here.room).centre, find(here.target).centre
        axes.plot([x, to_x], [y, to_y], color=_INK, linewidth=1.4, linestyle=(0, (2, 2)))
        axes.plot(to_x, to_y, "o", markersize=7, color=_PAPER, markeredgecolor=_INK)
    for number, stop in enumerate(stops):
        x, y = find(stop.room).centre
        size, letters = (17, 9) if stop is here else (13, 7.5)
        colour = _HOLDS if stop.found else _INK
        axes.plot(x, y, "o", markersize=size, color=colour, markeredgecolor=_PAPER)
        text = axes.text(x, y, str(number), size=letters, color=_PAPER, weight="bold")
        text.set(ha="center", va="center_baseline")


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
