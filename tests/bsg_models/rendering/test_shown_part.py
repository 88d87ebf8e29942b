"""What a page shows of a large building: within its limits, by its rule, and said in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from headless_browser import open_page, start_browser
from random_beliefs import CLASS_SPACE, make_belief

from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import from_hidden_counts
from bsg_models.rendering import shown_part
from bsg_models.rendering.explorer import View, explorer_page, write_explorer
from bsg_models.rendering.shown_part import choose_shown_part, count_buildings


def make_tower(rooms: int = 300, *, objects: int = 12) -> BeliefGraph:
    """Return a belief graph of many rooms, each with some objects, one in five without a class."""
    rng = np.random.default_rng(0)
    classes = CLASS_SPACE.classes
    seen = []
    for number in range(rooms * objects):
        kind = int(rng.integers(len(classes))) if number % 5 else None
        name = "thing" if kind is None else classes[kind]
        seen.append(SeenObject(str(number), number % (rooms + 1), name, name, kind))
    known = tuple(KnownRoom(f"r{n}", 0.5, True, "office") for n in range(rooms))
    doors = tuple((a, a + 1) for a in range(1, rooms))
    graph = PartialGraph("tower", CLASS_SPACE, 0.5, known, tuple(seen), doors)
    inputs = graph.histograms().astype(float)
    expectation = from_hidden_counts(inputs, poisson(rng.gamma(0.2, 1.0, inputs.shape)))
    return believe(graph, expectation, model="random")


def test_a_usual_building_is_shown_whole() -> None:
    belief = make_belief(10)
    part = choose_shown_part(belief)
    assert part.rooms == tuple(range(1, len(belief.partial.rooms) + 1))
    assert part.objects == tuple(range(len(belief.partial.objects)))
    assert part.blind == tuple(range(len(belief.blind)))
    assert part.left_out == ""
    assert '"left_out":""' in explorer_page([View(belief)])


def test_a_large_one_is_shown_by_the_rule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shown_part, "MOST_ROOMS", 150)
    monkeypatch.setattr(shown_part, "MOST_OBJECTS", 400)
    belief = make_tower()
    part = choose_shown_part(belief)
    assert len(part.rooms) == 150
    likeliest = np.argsort(-belief.presence[1:], axis=0)[:3] + 1
    assert set(likeliest.ravel().tolist()) <= set(part.rooms)
    for chosen in (part.objects, part.blind):
        assert 200 < len(chosen) <= 400
        assert list(chosen) == sorted(set(chosen))
    seen = [belief.partial.objects[number] for number in part.objects]
    assert {obj.room_index for obj in seen} == {0, *part.rooms}
    per_room = np.bincount([obj.room_index for obj in seen])
    assert per_room.max() - per_room[[0, *part.rooms]].min() <= 1  # rooms have the same share
    assert all(obj.class_index is not None for obj in seen)
    assert "150 of 300 rooms" in part.left_out
    assert f"{len(part.objects)} of 3,600 seen objects" in part.left_out
    assert "bsg-belief" in part.left_out


def test_a_page_holds_so_many_buildings(monkeypatch: pytest.MonkeyPatch) -> None:
    small = choose_shown_part(make_belief(10))
    monkeypatch.setattr(shown_part, "PAGE_ROOMS", 3 * len(small.rooms))
    assert [count_buildings([small] * number) for number in (0, 1, 3, 4)] == [0, 1, 3, 3]
    monkeypatch.setattr(shown_part, "PAGE_ROOMS", 0)
    assert count_buildings([small] * 4) == 1
    page = explorer_page([View(make_belief(10)), View(make_belief(12))])
    assert "This page shows the first 1 of 2 buildings." in page


def test_rooms_that_are_left_out_count_in_names(tmp_path: Path) -> None:
    belief = make_tower(210, objects=1)
    hidden = choose_shown_part(belief).rooms
    missing = sorted(set(range(1, 211)) - set(hidden))
    page = explorer_page([View(belief)])
    assert f'"office {hidden[-1]}"' in page
    assert all(f'"office {number}"' not in page for number in missing)
    assert len(missing) == 10


def test_the_page_says_what_it_leaves_out(tmp_path: Path) -> None:
    tower = make_tower(220, objects=2)
    views = [View(tower), View(replace(make_belief(10)))]
    write_explorer(views, tmp_path / "page.html")
    with (
        start_browser() as browser,
        open_page(browser, tmp_path / "page.html", fragment="#room=r9&class=sink") as page,
    ):
        assert "200 of 220 rooms" in page.locator("#left-out").inner_text()
        page.keyboard.press("Escape")
        without = sum(obj.class_index is None for obj in tower.partial.objects)
        assert f"{without} seen that belong to no class" in page.locator("aside").inner_text()
        page.select_option("#view", "1")
        assert not page.locator("#left-out").is_visible()
