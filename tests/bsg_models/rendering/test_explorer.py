"""The explorer in headless Chromium agrees with the beliefs; and the part that a page shows."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headless_browser import open_page, start_browser
from random_beliefs import CLASS_SPACE, HOSTILE, make_belief

from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.rendering import explorer
from bsg_models.rendering.explorer import View, explorer_page, write_explorer

SINK = CLASS_SPACE.classes.index("sink")
BOXES = """all => all.map((one) => {
  const box = one.getBoundingClientRect();
  return [one.textContent, box.left, box.top, box.right, box.bottom];
})"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with start_browser() as started:
        yield started


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """A page with two buildings, one with a truth and hostile names everywhere."""
    first, second = make_belief(10), make_belief(12, scene_id="t")
    partial = first.partial
    rooms = tuple(replace(room, label=HOSTILE) for room in partial.rooms)
    hostile = replace(first, partial=replace(partial, rooms=rooms, scene_id=HOSTILE), model=HOSTILE)
    truth = np.ceil(hostile.expected).astype(int)
    write_explorer([View(hostile, truth), View(second)], tmp_path / "page.html")
    with open_page(browser, tmp_path / "page.html") as opened:
        yield opened


def make_crowd(count: int = 48, *, objects: int = 20) -> BeliefGraph:
    """Return a belief graph of many rooms on three storeys, small and large, many of one label."""
    rng = np.random.default_rng(0)
    labels = ("bedroom", "bathroom", "hallway/living room", "closet", None)
    rooms = []
    for number in range(count):
        floor, place = divmod(number, count // 3 + 1)
        x, y = 3.4 * (place % 6), 3.1 * (place // 6)
        wide, deep = (float(side) for side in rng.uniform(0.9, 4.2, 2))
        rooms.append(
            KnownRoom(
                f"r{number}",
                float(rng.random()),
                bool(rng.random() < 0.8),
                labels[int(rng.integers(len(labels)))],
                footprint=((x, y), (x + wide, y), (x + wide, y + deep), (x, y + deep)),
                floor_index=floor,
            )
        )
    seen = tuple(
        SeenObject(str(k), int(rng.integers(1, count + 1)), "sink", "sink", SINK if k % 5 else None)
        for k in range(objects)
    )
    doors = tuple((a, a + 1) for a in range(1, count))
    graph = PartialGraph("crowd", CLASS_SPACE, 0.5, tuple(rooms), seen, doors)
    inputs = graph.histograms().astype(float)
    expectation = from_hidden_counts(inputs, poisson(rng.gamma(0.2, 1.0, inputs.shape)))
    return believe(graph, expectation, model="random")


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("explorer") / "crowd.html"
    write_explorer([View(make_crowd())], path)
    return path


def percent(presence: float) -> str:
    if presence > 0.995:
        return "> 99 %"
    return "< 1 %" if 0 < presence < 0.005 else f"{int(100 * presence + 0.5)} %"


def test_a_room_is_chosen_by_mouse_and_by_keyboard(page: Any) -> None:
    page.locator("polygon.ground").first.click()
    assert page.locator(".room.chosen").count() >= 1
    assert page.locator("table.histogram tbody tr").count() > 0
    assert page.locator("table.histogram .true").count() > 0  # the truth is known here
    page.keyboard.press("Escape")
    assert page.locator(".room.chosen").count() == 0
    page.locator("g.room[data-node='1'][tabindex]").focus()
    page.keyboard.press("Enter")
    assert page.locator(".room.chosen").count() >= 1


def test_rooms_are_ranked_by_the_chance_of_the_class(browser: Any, crowd: Path) -> None:
    belief = make_crowd()
    chances, more = belief.presence[1:, SINK], (belief.expected - belief.inputs)[1:, SINK]
    order = np.lexsort((np.arange(48), -np.round(chances, 4))) + 1
    with open_page(browser, crowd) as page:
        page.select_option("#class", str(SINK))
        assert page.locator(".rooms summary").count() == 0
        assert page.locator("aside summary").inner_text() == "38 more"
        page.locator("aside summary").click()
        rows = page.locator(".rooms button").all()
        assert [int(row.get_attribute("data-key")) for row in rows] == order.tolist()
        for row, node in zip(rows, order.tolist(), strict=True):
            said = re.fullmatch(
                r"(.+ %), (?:< )?([0-9.]+) more expected(?:, ([0-9]+) seen)?",
                row.locator(".much").inner_text(),
            )
            assert said, row.inner_text()
            assert said[1] == percent(round(chances[node - 1], 4))
            assert float(said[2]) == pytest.approx(more[node - 1], abs=0.051)
            assert int(said[3] or 0) == belief.inputs[node, SINK]
        whole = page.locator("aside p.answer").inner_text()
        chance = percent(round(belief.presence[0, SINK], 4))
        assert f"{chance} for at least one unseen sink" in whole


def test_a_room_of_the_ranking_is_opened_and_left_by_keyboard(browser: Any, crowd: Path) -> None:
    with open_page(browser, crowd) as page:
        page.select_option("#class", str(SINK))
        row = page.locator(".rooms button").nth(2)
        node, name = row.get_attribute("data-key"), row.locator(".what").inner_text()
        row.focus()
        assert page.locator(".room.hinted").first.get_attribute("data-node") == node
        page.keyboard.press("Enter")
        assert page.locator("aside h2").inner_text() == name
        assert "Rank 3 of 48 rooms." in page.locator("aside p.answer").inner_text()
        assert page.locator(".room.chosen").first.get_attribute("data-node") == node
        page.keyboard.press("Enter")  # the way back has the focus
        assert page.locator("aside h2").inner_text() == "crowd"
        assert page.evaluate("document.activeElement.dataset.key") == node


@pytest.mark.parametrize(
    ("drawing", "sought", "width"),
    [("plan", "", 1366), ("layers", "&class=sink&room=r7", 900), ("plan", "", 390)],
)
def test_no_name_covers_another(
    browser: Any, crowd: Path, drawing: str, sought: str, width: int
) -> None:
    fragment = f"#drawing={drawing}{sought}"
    size = {"width": width, "height": 800}
    with open_page(browser, crowd, fragment=fragment, viewport=size) as page:
        boxes = page.eval_on_selector_all(".name, .storey, .thing", BOXES)
        frame = page.locator("svg.graph").bounding_box()
    assert len(boxes) >= (40 if width > 600 else 20)
    for k, (name, left, top, right, bottom) in enumerate(boxes):
        assert frame["x"] <= left < right <= frame["x"] + frame["width"], name
        for other, left2, top2, right2, bottom2 in boxes[:k]:
            apart = right <= left2 or right2 <= left or bottom <= top2 or bottom2 <= top
            assert apart, f"{name} covers {other}"


def test_a_link_opens_the_same_view(page: Any, browser: Any, tmp_path: Path) -> None:
    page.select_option("#view", "1")
    page.select_option("#class", str(SINK))
    page.locator("#threshold").fill("30")
    page.locator("#plan").click()
    page.locator("polygon.ground").first.click()
    page.locator("button.theme").click()
    fragment = "#" + page.url.partition("#")[2]
    room = page.locator("aside h2").inner_text()
    with open_page(browser, tmp_path / "page.html", fragment=fragment) as again:
        assert again.locator("#view").input_value() == "1"
        assert again.locator("#class").input_value() == str(SINK)
        assert again.locator("#threshold").input_value() == "30"
        assert again.locator("#plan").get_attribute("aria-pressed") == "true"
        assert again.locator("aside h2").inner_text() == room != "t"
        assert again.locator("html").get_attribute("data-theme") == "dark"
        assert again.url == page.url
        again.evaluate("location.hash = '#theme=light'")  # a link in the page that is open
        again.locator("html[data-theme='light']").wait_for()
        assert again.locator("aside h2").inner_text() == HOSTILE
        assert again.locator("#threshold").input_value() == "0"


def test_a_building_without_rooms_is_shown(browser: Any, tmp_path: Path) -> None:
    graph = PartialGraph("empty", CLASS_SPACE, 0.5, (), (), ())
    inputs = graph.histograms().astype(float)
    expectation = from_hidden_counts(inputs, poisson(np.full(inputs.shape, 0.1)))
    write_explorer([View(believe(graph, expectation, model="random"))], tmp_path / "page.html")
    for drawing in ("plan", "layers"):
        fragment = f"#drawing={drawing}&class=sink"
        with open_page(browser, tmp_path / "page.html", fragment=fragment) as page:
            assert "no rooms are known" in page.locator("svg.graph").text_content()
            assert "10 % for at least one unseen sink" in page.locator("aside").inner_text()


def read_views(page: str) -> tuple[str, list[dict[str, Any]]]:
    (data,) = re.findall(r'id="beliefs">(.*?)</script>', page, re.DOTALL)
    found = json.loads(data)
    return found["left_out"], found["views"]


def test_a_usual_building_is_shown_whole() -> None:
    belief = make_belief(10)
    left_out, (view,) = read_views(explorer_page([View(belief)]))
    assert (left_out, view["left_out"]) == ("", "")
    assert [room["id"] for room in view["rooms"]] == [room.name for room in belief.partial.rooms]
    assert len(view["objects"]) == len(belief.partial.objects)
    assert len(view["blind"]) == len(belief.blind)


def test_of_a_large_building_the_promising_rooms_are_shown_evenly() -> None:
    belief = make_crowd(220, objects=4400)
    _, (view,) = read_views(explorer_page([View(belief)]))
    shown = [int(room["id"][1:]) + 1 for room in view["rooms"]]
    assert shown == sorted(shown)
    assert len(shown) == 200
    likeliest = np.argsort(-belief.presence[1:], axis=0)[:3] + 1
    assert set(likeliest.ravel().tolist()) <= set(shown)
    hidden = belief.hidden.sum(axis=1)
    left = set(range(1, 221)) - set(shown)
    others = set(shown) - set(likeliest.ravel().tolist())
    assert hidden[list(left)].max() <= hidden[list(others)].min()
    per_room = np.bincount([obj["room"] for obj in view["objects"]])
    there = np.bincount([obj.room_index for obj in belief.partial.objects])[[0, *shown]]
    assert per_room.sum() == 2500
    assert (per_room[per_room < there] >= per_room.max() - 1).all(), "each has its turn"
    assert view["input"][0] == belief.inputs[0].tolist(), "the numbers count all of it"


def test_a_page_holds_so_many_buildings(monkeypatch: pytest.MonkeyPatch) -> None:
    views = [View(make_belief(10, scene_id=name)) for name in "abcd"]
    rooms = len(views[0].belief.partial.rooms)
    for most, expected in ((4 * rooms, 4), (3 * rooms, 3), (0, 1)):
        monkeypatch.setattr(explorer, "PAGE_ROOMS", most)
        left_out, shown = read_views(explorer_page(views))
        assert len(shown) == expected
        assert bool(left_out) == (expected < 4)
