"""The page of a replay in headless Chromium: it plays, answers the keyboard, and runs no data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from headless_browser import open_page, start_browser
from random_beliefs import HOSTILE
from replays import make_replay

from bsg_models.rendering.replay import replay_page

BOTTOMS = "walls => walls.map((wall) => wall.getBBox().y + wall.getBBox().height)"


def test_the_page_says_how_the_search_was_chosen_and_what_all_came_to() -> None:
    page = replay_page(make_replay())
    for words in ("It was drawn by hand.", "mean of 1,500 searches", "40 % (31 to 52)", "44 %"):
        assert words in page
    assert "1 room cannot be reached and is not drawn." in page
    drawn = replay_page(replace(make_replay(), unit="", world="star:1-10", doors=(), left_out=0))
    assert "costs are drawn at random (star:1-10)" in drawn
    assert "cannot be reached" not in drawn


def words(page: Any) -> list[str]:
    return [part.inner_text() for part in page.locator(".told").all()]


def test_both_robots_go_step_by_step(tmp_path: Path) -> None:
    """The whole plan is there on load; on a phone, both robots are on the first screen."""
    path, plain = tmp_path / "page.html", tmp_path / "plain.html"
    path.write_text(replay_page(make_replay(name=HOSTILE, artifact=HOSTILE)), "utf-8")
    plain.write_text(replay_page(make_replay()), "utf-8")
    with start_browser() as browser:
        phone = {"width": 360, "height": 640}
        with open_page(browser, plain, viewport=phone) as page:
            for plan in page.locator(".walk svg").all():
                box, bottoms = plan.bounding_box(), plan.locator(".wall").evaluate_all(BOTTOMS)
                assert max(bottoms) <= box["height"]
                assert box["y"] + box["height"] <= phone["height"]
            assert page.evaluate("document.documentElement.scrollWidth") == phone["width"]
        with open_page(browser, path) as page:
            assert page.locator("h1").inner_text() == f"Looking for {HOSTILE}"
            assert page.locator("#where").inner_text() == "room 0 of 3"
            assert (page.locator(".likely").count(), page.locator(".robot").count()) == (3, 2)
            assert words(page)[0] == (
                "Begins in hall: saw 2 × lamp. Next: bedroom 1, 3.0 m away, 20 % likely."
            )
            assert words(page)[1].endswith("Next: bedroom 1, 3.0 m away.")
            page.locator("#on").click()
            assert words(page)[0].startswith("Entered bedroom 1: saw no object of a class.")
            page.keyboard.press("ArrowRight")
            assert page.locator(".walk.done").count() == 1
            assert "Found: " + HOSTILE in words(page)[0]
            page.keyboard.press("End")
            assert page.locator(".cost").all_inner_texts() == ["9.0 m", "16.0 m"]
            assert page.locator(".way").count() == 3 + 5
            page.locator("#step").fill("1")
            assert page.url.endswith("#1")
