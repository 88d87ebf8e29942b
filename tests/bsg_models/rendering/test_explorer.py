"""The explorer in headless Chromium: it loads, shades, answers the keyboard, and runs no data."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_beliefs import HOSTILE, make_belief

from bsg_models.rendering.explorer import Moment, View, write_explorer

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    with playwright.sync_playwright() as started:
        found = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield found
        found.close()


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """A page with two buildings, one with a truth and hostile names everywhere."""
    first, second = make_belief(11), make_belief(12, scene_id="t")
    partial = first.partial
    rooms = tuple(replace(room, label=HOSTILE) for room in partial.rooms)
    hostile = replace(first, partial=replace(partial, rooms=rooms, scene_id=HOSTILE), model=HOSTILE)
    truth = np.ceil(hostile.expected).astype(int)
    write_explorer([View(hostile, truth), View(second)], tmp_path / "page.html")
    opened = browser.new_page(viewport={"width": 1366, "height": 768})
    opened.faults = []
    opened.on(
        "console", lambda said: opened.faults.append(said.text) if said.type == "error" else None
    )
    opened.on("pageerror", lambda error: opened.faults.append(str(error)))
    opened.on("dialog", lambda dialog: (opened.faults.append(dialog.message), dialog.dismiss()))
    opened.goto(f"file://{tmp_path}/page.html")
    yield opened
    assert opened.faults == []
    opened.close()


def fills(page: Any) -> list[str]:
    found: list[str] = page.eval_on_selector_all(
        "polygon.ground", "all => all.map(one => one.getAttribute('fill'))"
    )
    return found


def test_names_from_the_data_are_text(page: Any) -> None:
    assert page.locator("aside h2").inner_text() == HOSTILE
    assert page.locator("img").count() == 0
    assert HOSTILE in page.locator("aside").inner_text()


def test_the_class_picker_shades_the_rooms(page: Any) -> None:
    before = fills(page)
    options = page.locator("#class option").count()
    assert options == 46
    page.select_option("#class", "3")
    assert fills(page) != before
    page.select_option("#class", "-1")
    assert fills(page) == before


def test_the_threshold_hides_weak_blind_nodes(page: Any) -> None:
    shown = page.locator("circle.blind").count()
    assert shown == len(make_belief(11).blind)
    page.locator("#threshold").fill("100")
    assert page.locator("circle.blind").count() < shown
    assert page.locator("#shown").inner_text() == "100 %"


def test_a_room_is_chosen_by_mouse_and_by_keyboard(page: Any) -> None:
    page.locator("polygon.ground").first.click()
    assert page.locator(".room.chosen").count() >= 1
    assert page.locator("table.histogram tr").count() > 0
    assert page.locator("table.histogram .true").count() > 0  # the truth is known here
    page.keyboard.press("Escape")
    assert page.locator(".room.chosen").count() == 0
    page.locator("g.room[data-node='1'][tabindex]").focus()
    page.keyboard.press("Enter")
    assert page.locator(".room.chosen").count() >= 1


def test_another_building_and_the_plan(page: Any) -> None:
    page.select_option("#view", "1")
    assert page.locator("aside h2").inner_text() == "t"
    assert page.locator("table.histogram .true").count() == 0
    page.locator("#plan").click()
    assert page.locator("#plan").get_attribute("aria-pressed") == "true"
    assert page.locator("ellipse").count() == 0  # the building stands above the layers alone


def test_a_search_is_replayed_room_by_room(browser: Any, tmp_path: Path) -> None:
    belief = make_belief(7)
    rooms = len(belief.partial.rooms)
    truth = np.ceil(belief.expected).astype(int)
    moments = [
        Moment(
            artifacts=(3, 35),
            route=tuple(range(1, k + 1)),
            cost=2.5 * k,
            target=k + 1 if k < 3 else None,
            legs=(None, 1.0, 2.5, 4.0, None) if k < 3 else (),
            holds=(2,),
            planner="ratio",
            world="star:1-10",
        )
        for k in range(1, 4)
    ]
    assert rooms >= 3
    views = [View(belief, truth, moment=moment) for moment in moments]
    write_explorer(views, tmp_path / "page.html")
    page = browser.new_page(viewport={"width": 1366, "height": 768})
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.goto(f"file://{tmp_path}/page.html")
    assert "Looking for" in page.locator("aside").inner_text()
    assert "says ratio" in page.locator("aside").inner_text()
    assert page.locator("circle.robot").count() == 1
    assert page.locator(".room.holds").count() == 1
    assert page.locator("table.rooms tr").count() == rooms - 1
    assert page.locator("table.rooms tr.picked").inner_text().endswith("2.5")
    assert "∞: out of reach" in page.locator("aside").inner_text()
    assert "costs are drawn" in page.locator("aside").inner_text()
    assert "any of " in page.locator(".legend").inner_text()
    page.locator("#on").click()
    assert page.locator("circle.robot").count() == 2
    page.locator("#step").fill("2")
    assert page.locator("circle.robot").count() == 3
    assert "The search is over" in page.locator("aside").inner_text()
    assert page.locator("#where").inner_text() == "step 2 of 2"
    page.locator("#back").click()
    page.locator("#layers").click()
    assert page.locator("circle.robot").count() == 2
    page.select_option("#class", "-1")
    assert faults == []
    page.close()
