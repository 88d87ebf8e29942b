"""A picture that moves: one frame a room, the same bytes each time, and no other format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from refusals import refuses
from replays import make_replay

from bsg_data.errors import RecipeError
from bsg_data.results import refuse_file
from bsg_models.rendering.animation import FRAME_MS, LAST_MS, draw_frame, write_animation


@pytest.mark.parametrize("suffix", ["gif", "png"])
def test_frames_are_steps_and_bytes_are_the_same(suffix: str, tmp_path: Path) -> None:
    replay = make_replay()
    first, second = tmp_path / f"new/search.{suffix}", tmp_path / f"search.{suffix.upper()}"
    for path in (first, second):
        write_animation(replay, path)
    assert first.read_bytes() == second.read_bytes()
    refuse_file(first, force=True)  # it says who made it, so a later command may replace it
    with Image.open(first) as picture:
        assert picture.n_frames == replay.steps + 1 == 4  # type: ignore[attr-defined]
        assert picture.info["loop"] == 0
        times, frames = [], []
        for k in range(replay.steps + 1):
            picture.seek(k)
            times.append(picture.info["duration"])
            frames.append(np.asarray(picture.convert("RGB")))
    assert times == [FRAME_MS] * 3 + [LAST_MS]
    for k, frame in enumerate(frames):  # a palette changes a colour by a little
        assert np.abs(frame - np.asarray(draw_frame(replay, k)).astype(float)).mean() < 3
        assert (frame[:, [*range(6), *range(-6, 0)]] > 250).all(), "no line is cut off at an edge"
    left, right = np.split(frames[2] - frames[3].astype(float), 2, axis=1)
    assert np.abs(right).sum() > 20 * np.abs(left[200:]).sum()  # the left robot is done by then
    assert first.stat().st_size < 150_000


def test_another_format_is_refused(tmp_path: Path) -> None:
    with refuses(RecipeError, "suffix-unknown", tmp_path / "search.mp4"):
        write_animation(make_replay(), tmp_path / "search.mp4")
    assert list(tmp_path.iterdir()) == []
