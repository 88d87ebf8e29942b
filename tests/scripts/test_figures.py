"""The pictures of README and the docs are those that `make figures` draws, but one of old."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY, list_unpinned, load_script
from PIL import Image
from replays import make_replay

CONCEPTS, SEARCH = load_script("figures/concepts"), load_script("figures/search")
FIGURES = REPOSITORY / "docs" / "figures"
NUMBER = re.compile(r"\d+\.\d+")  # a place; processors differ in its last digits


def test_every_picture_is_drawn_by_make_figures() -> None:
    recipe = (REPOSITORY / "Makefile").read_text("utf-8").split("\nfigures:")[1].split("\n\n")[0]
    drawn = set(re.findall(r"docs/figures/(\w+\.(?:png|svg))", recipe)) | set(CONCEPTS.FIGURES)
    assert drawn | {"robot.png"} == {path.name for path in FIGURES.iterdir()}


def test_a_search_has_a_frame_for_every_room(tmp_path: Path) -> None:
    replay = make_replay()
    SEARCH.draw_replay(replay, tmp_path / "search.png")
    with Image.open(tmp_path / "search.png") as picture:
        assert picture.n_frames == replay.steps + 1 == 4  # type: ignore[attr-defined]
        edge = np.asarray(picture.convert("RGB"))[:, [*range(6), *range(-6, 0)]]
    assert (edge > 250).all(), "no line is cut off"


@pytest.mark.heavy
@pytest.mark.parametrize("name", CONCEPTS.FIGURES)
def test_a_figure_of_the_concepts_is_drawn_the_same(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if other := list_unpinned("matplotlib"):
        pytest.skip(f"{other} draws other bytes than the pinned one")
    monkeypatch.setattr(CONCEPTS, "FIGURES", {name: CONCEPTS.FIGURES[name]})
    result = CliRunner().invoke(CONCEPTS.main, ["--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    now, kept = ((folder / name).read_text("utf-8") for folder in (tmp_path, FIGURES))
    assert NUMBER.sub("", now) == NUMBER.sub("", kept), "run `make figures`"
    places = [[float(one) for one in NUMBER.findall(text)] for text in (now, kept)]
    assert places[0] == pytest.approx(places[1], abs=0.01), "run `make figures`"
