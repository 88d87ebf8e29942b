"""The explorer in headless Chromium agrees with the beliefs; and the part that a page shows."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headless_browser import open_page, start_browser
from random_beliefs import CLASS_SPACE, HOSTILE, make_belief

from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import (
    Custom,
    KnownRoom,
    PartialGraph,
    Remembered,
    SeenObject,
    Sighting,
)
from bsg_models.rendering.explorer import ShownBelief, explorer_page, write_explorer

SINK = CLASS_SPACE.classes.index("sink")
BOXES = """all => all.map((one) => {
  const box = one.getBoundingClientRect();
  return [one.textContent, box.left, box.top, box.right, box.bottom];
})"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with start_browser() as started:
        yield started


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
    expectation = Expectation(inputs, poisson(rng.gamma(0.2, 1.0, inputs.shape)))
    return believe(graph, expectation, model="random")


@pytest.fixture(scope="module")
def crowd(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("explorer") / "crowd.html"
    write_explorer([ShownBelief(make_crowd())], path)
    return path


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


def make_home() -> BeliefGraph:
    """Return a home of four rooms with places, one of which lies behind two others in layers."""
    spots = {
        "living": (0.0, 0.0),
        "hall": (4.0, 0.0),
        "kitchen": (2.0, 5.0),
        "upstairs": (9.0, 0.0),
    }
    rooms = tuple(
        KnownRoom(name, 0.5, name == "living", position=(*spot, 0.0))
        for name, spot in spots.items()
    )
    seen = (
        SeenObject("7", 1, "sink", "sink", SINK),
        SeenObject("8", 0, "sink", "sink", SINK),
        SeenObject("9", 0, "zzqx", None, None),
    )
    graph = PartialGraph(
        *("home", CLASS_SPACE, 0.5, rooms, seen, ((1, 2), (2, 3), (2, 4))),
        now=36_000.0,
        memory=(Remembered("7", "sink", (Sighting(3600.0, 2, None),)),),
        customs=(Custom("drinks", 3, "table"), Custom("drinks", None, "sofa", never=True)),
    )
    inputs = graph.histograms().astype(float)
    means = np.random.default_rng(1).gamma(0.2, 1.0, inputs.shape)
    return believe(graph, Expectation(inputs, poisson(means)), model="random")


def make_answer() -> dict[str, Any]:
    """Return an answer for the home: a thing that no model counts, and a sink."""

    def place(room: str | None, chance: float, *seen: str, cost: float | None = None) -> Any:
        counted = dict.fromkeys(("probability", "unseen", "expected"), chance)
        about = {"room": room, "label": None, "if_there": chance / 0.7, "seen": [*seen]}
        return {**about, **counted, "cost": cost}

    places = [
        place("kitchen", 0.64, cost=9.0),
        place("explore", 0.1),
        place("upstairs", 0.004, cost=math.inf),
        place("hall", 0.003, cost=4.0),
        place("living", 0.002, cost=0.0),
    ]
    seen = [place("living", 1.0, "7"), place(None, 1.0, "8"), *places[:4]]
    habits = [
        {"room": "hall", "share": 0.75, "sightings": 1, "last": 3600.0, "told": False},
        {"room": None, "share": 0.25, "sightings": 0, "last": None, "told": True},
    ]
    mug = {"thing": "mug", "class": None, "by": "likeness", "how": "as its nearest words"}
    sink = {"thing": "sink", "class": "sink", "by": "class", "how": ""}
    stops = [("kitchen", 0.64, 0.64), ("explore", 0.1, 0.67), ("upstairs", 0.004, 0.7)]
    always = {"label": None, "way": 9.0, "look": 4.25, "any_found": 0.9}
    return {
        "here": "living",
        "go_first": "kitchen",
        "cost_unit": "m",
        "things": [
            {**mug, "model": "nouns", "habits": [], "anywhere": 0.7, "places": places},
            {
                **sink,
                "model": "random",
                "habits": [{"piece": None, **habit} for habit in habits],
                "anywhere": 1.0,
                "places": seen,
            },
        ],
        "plan": [
            {"room": room, "probability": chance, "found": found, "seconds": 26.5 * number} | always
            for number, (room, chance, found) in enumerate(stops, 1)
        ],
        "found_within": 0.7,
    }


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of a home with an answer, of one with hostile names and a truth, and of none."""
    hostile = make_belief(10)
    rooms = tuple(replace(room, label=HOSTILE) for room in hostile.partial.rooms)
    partial = replace(hostile.partial, rooms=rooms, scene_id=HOSTILE)
    hostile = replace(hostile, partial=partial, model=HOSTILE)
    empty = PartialGraph("empty", CLASS_SPACE, 0.5, (), (), ())
    inputs = empty.histograms().astype(float)
    expectation = Expectation(inputs, poisson(np.full(inputs.shape, 0.1)))
    views = [
        ShownBelief(make_home(), answer=make_answer()),
        ShownBelief(hostile, np.ceil(hostile.expected).astype(int)),
        ShownBelief(believe(empty, expectation, model="random")),
    ]
    path = tmp_path_factory.mktemp("explorer") / "home.html"
    write_explorer(views, path)
    return path


def test_a_page_tells_its_answer_and_shows_what_is_asked(browser: Any, home: Path) -> None:
    """By mouse, by keyboard and by a link."""
    with open_page(browser, home) as page:
        assert page.locator("#class option:checked").inner_text() == "mug (asked)"
        panel = page.locator("aside").inner_text()
        for words in ("Go first to kitchen", "70 % of such buildings, by the model nouns"):
            assert words in panel
        rows = [text.split("\n") for text in page.locator(".rooms li").all_inner_texts()]
        assert [" ".join(row).strip() for row in rows] == [
            "kitchen if there is one: 91 %, noted: 64 %, 9.0 m",
            "rooms not found yet if there is one: 14 %, noted: 10 %",
            "upstairs if there is one: 1 %, noted: < 1 %",
            "hall if there is one: < 1 %, noted: < 1 %, 4.0 m",
            "living if there is one: < 1 %, noted: < 1 %, robot here",
        ]
        steps = page.locator("table.way tbody tr").all_inner_texts()
        assert [" ".join(step.split()) for step in steps] == [
            "1 kitchen 64 % 27 s 64 % 90 %",
            "2 rooms not found yet 10 % 53 s 67 % 90 %",
            "3 upstairs < 1 % 80 s 70 % 90 %",
        ]
        page.select_option("#class", "-1")
        assert page.locator("g.stop").count() == 0
        assert page.locator("circle.robot").count() > 0, "the robot stays there"
        page.select_option("#view", "1")
        page.locator("#layers").click()
        page.locator("polygon.ground").first.click()
        assert page.locator(".room.chosen").count() >= 1
        assert page.locator("table.histogram .true").count() > 0  # the truth is known here
        page.keyboard.press("Escape")
        assert page.locator(".room.chosen").count() == 0
        page.locator("g.room[data-node='1'][tabindex]").focus()
        page.keyboard.press("Enter")
        page.select_option("#class", str(SINK))
        page.locator("#threshold").fill("30")
        page.locator("button.theme").click()
        link, room = page.url, page.locator("aside h2").inner_text()
        assert room.startswith(HOSTILE)
    with open_page(browser, home, fragment="#" + link.partition("#")[2]) as again:
        assert again.url == link
        assert again.locator("aside h2").inner_text() == room
        assert again.locator("#class").input_value() == str(SINK)
        assert again.locator("#threshold").input_value() == "30"
        assert again.locator("html").get_attribute("data-theme") == "dark"
        again.evaluate("location.hash = '#building=empty&class=sink'")  # in the page that is open
        again.locator("text=no rooms are known").wait_for()
        assert "10 % for at least one unseen sink" in again.locator("aside").inner_text()


@pytest.mark.parametrize("drawing", ["plan", "layers"])
def test_the_way_is_drawn_from_the_robot(browser: Any, home: Path, drawing: str) -> None:
    with open_page(browser, home, fragment=f"#drawing={drawing}") as page:
        middle = """all => all.map((one) => {
          const { left, right, top, bottom } = one.getBoundingClientRect();
          return [Math.round((left + right) / 2), Math.round((top + bottom) / 2)];
        })"""
        robot, _ = page.eval_on_selector_all("circle.robot", middle)
        stops = page.eval_on_selector_all("g.stop circle", middle)
        rooms = page.eval_on_selector_all("polygon.ground", middle)
        frame = page.locator("svg.graph").bounding_box()
        points = page.locator("polyline.later").get_attribute("points")
        way = [[float(v) for v in spot.split(",")] for spot in points.split()]
        assert page.locator("g.stop text").all_text_contents() == ["1", "3"]
        nodes = page.eval_on_selector_all(
            "polygon.ground", "all => all.map((one) => Number(one.parentElement.dataset.node))"
        )
        where = dict(zip(nodes, rooms, strict=True))
        assert np.abs(np.subtract([robot, *stops], [where[1], where[3], where[4]])).max() <= 1
        drawn = np.add(way, [frame["x"], frame["y"]])
        through_the_hall = [robot, where[2], stops[0], where[2], stops[1]]
        assert np.abs(drawn - through_the_hall).max() <= 1
        assert "robot" in page.locator("text.name").all_text_contents()


def test_objects_in_no_room_are_drawn(browser: Any, home: Path) -> None:
    for drawing, sought, count in (("plan", "", 2), ("layers", "", 2), ("plan", "sink", 1)):
        with open_page(browser, home, fragment=f"#drawing={drawing}&find={sought}") as page:
            assert page.locator("circle.object[data-node='0']").count() == count
            assert f"{count} in no room" in page.locator("svg.graph").text_content()
    with open_page(browser, home, fragment="#find=sink") as page:
        assert page.locator("circle.sought").count() == 2
        assert "1 seen: 7" in page.locator(".rooms li").first.inner_text()
        assert "As of 36,000 s." in page.locator("aside").inner_text()
        rows = page.locator("table.taught tbody tr").all_inner_texts()
        assert [row.split("\t") for row in rows] == [
            ["hall", "75 %", "1", "9 h ago", "–"],
            ["elsewhere", "25 %", "–", "–", "yes"],
        ]
        page.select_option("#class", "-1")
        rows = page.locator("table.taught tbody tr").all_inner_texts()
        assert [row.split("\t") for row in rows] == [
            ["sink", "hall: 1", "1", "9 h ago", "–"],
            ["drinks", "–", "–", "–", "kitchen, table; never: sofa"],
        ]


def read_views(page: str) -> list[dict[str, Any]]:
    (data,) = re.findall(r'id="beliefs">(.*?)</script>', page, re.DOTALL)
    return list(json.loads(data)["views"])


def test_of_a_large_building_the_promising_rooms_are_shown_evenly() -> None:
    belief = make_crowd(220, objects=4400)
    (view,) = read_views(explorer_page([ShownBelief(belief)]))
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
    out = sorted({f"r{k}" for k in range(220)} - {room["id"] for room in view["rooms"]})
    answer = make_answer()
    plan = [{**answer["plan"][0], "room": room} for room in out]
    answer |= {"here": out[0], "go_first": out[1], "plan": plan}
    (view,) = read_views(explorer_page([ShownBelief(belief, answer=answer)]))
    names = [room["id"] for room in view["rooms"]]
    shown = view["answer"]
    assert [names[shown[key] - 1] for key in ("here", "go_first")] == out[:2]
    stops = [names[stop["room"] - 1] for stop in shown["plan"]]
    assert stops == out[: len(stops)]
    assert 10 <= len(stops) < 20, "the others are left out"
