"""The page of a replay in headless Chromium: it plays, answers the keyboard, and runs no data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from headless_browser import open_page, start_browser
from random_beliefs import HOSTILE
from replays import make_replay

from bsg_models.rendering.replay import replay_page


def test_the_page_says_how_the_search_was_chosen_and_what_all_came_to() -> None:
    page = replay_page(make_replay())
    for words in ("It was drawn by hand.", "mean of 1,500 searches", "40 % (31 to 52)", "44 %"):
        assert words in page
    assert "1 room cannot be reached and is not drawn." in page
    drawn = replay_page(replace(make_replay(), unit="", world="star:1-10", doors=(), left_out=0))
    assert "costs are drawn at random (star:1-10)" in drawn
    assert "cannot be reached" not in drawn


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with start_browser() as started:
        yield started


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """A page of a search with hostile names."""
    (tmp_path / "page.html").write_text(
        replay_page(make_replay(name=HOSTILE, artifact=HOSTILE)), "utf-8"
    )
    with open_page(browser, tmp_path / "page.html") as opened:
        yield opened


def told(page: Any) -> list[str]:
    return [part.inner_text() for part in page.locator(".told").all()]


BOTTOMS = "walls => walls.map((wall) => wall.getBBox().y + wall.getBBox().height)"


@pytest.mark.parametrize("size", [(1366, 768), (360, 640)])
def test_the_whole_plan_is_there_on_load(
    browser: Any, tmp_path: Path, size: tuple[int, int]
) -> None:
    """On a phone, too; there both robots are on the first screen."""
    (tmp_path / "page.html").write_text(replay_page(make_replay()), "utf-8")
    viewport = dict(zip(("width", "height"), size, strict=True))
    with open_page(browser, tmp_path / "page.html", viewport=viewport) as opened:
        for plan in opened.locator(".walk svg").all():
            box, bottoms = plan.bounding_box(), plan.locator(".wall").evaluate_all(BOTTOMS)
            assert max(bottoms) <= box["height"]
            assert box["y"] + box["height"] <= size[1]
        assert opened.evaluate("document.documentElement.scrollWidth") == size[0]


def test_both_robots_go_step_by_step(page: Any) -> None:
    assert page.locator("h1").inner_text() == f"Looking for {HOSTILE}"
    assert page.locator("img").count() == 0
    assert page.locator("#where").inner_text() == "room 0 of 3"
    assert [part.count() for part in (page.locator(".likely"), page.locator(".robot"))] == [3, 2]
    assert told(page)[0] == (
        "Begins in hall: saw 2 × lamp. Next: bedroom 1, 3.0 m away, 20 % likely."
    )
    assert told(page)[1].endswith("Next: bedroom 1, 3.0 m away.")
    page.locator("#on").click()
    assert told(page)[0].startswith("Entered bedroom 1: saw no object of a class.")
    page.keyboard.press("ArrowRight")
    assert page.locator(".walk.done").count() == 1
    assert page.locator(".robot.found").count() == 1
    assert "Found: " + HOSTILE in told(page)[0]
    assert page.locator(".cost").all_inner_texts() == ["9.0 m", "6.5 m"]
    page.keyboard.press("End")
    assert page.locator(".cost").all_inner_texts() == ["9.0 m", "16.0 m"]  # the first robot stays
    assert page.locator(".way").count() == 3 + 5
    page.keyboard.press("Home")
    page.locator("#step").fill("1")
    assert page.locator("#where").inner_text() == "room 1 of 3"
    assert page.url.endswith("#1")
