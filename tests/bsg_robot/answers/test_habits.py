"""Any story of reports, late ones too: what must hold of all that is answered."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from bsg_data.errors import RecipeError
from bsg_models import Predictor
from bsg_robot import SeenBuilding, open_graph
from bsg_robot.graph.robot_json import encode_robot_graph

UNIVERSAL = Predictor()
NOW = 1_795_867_200.0
ROOMS = ("kitchen", "bathroom", "bedroom", "hall", "living room")
FURNITURE = ("table", "shelf", "fridge", "cabinet", "tray")
THINGS = ("keys", "mug", "cup", "milk", "red mug", "towel", "book", "zzqx", "bed")
ASKED = ("keys", "mug", "milk", "bed", "tableware")
HOUR = 3600.0


class Story:
    """A robot that reports at random; whatever is refused changes nothing."""

    def __init__(self, seed: int) -> None:
        self.random = draw = random.Random(seed)
        names = draw.sample(ROOMS, draw.randint(1, 4))
        rooms = [{"id": name, "visited": draw.random() < 0.6} for name in names]
        clock = {"now": draw.choice([0, NOW, -50])} if draw.random() < 0.5 else {}
        home = {"scene_id": "home", "rooms": rooms, "more_rooms": draw.choice([0, True])}
        self.seen = open_graph({**home, **clock}, model=UNIVERSAL)
        self.told: list[str] = []

    def go_on(self, steps: int) -> None:
        for _ in range(steps):
            before, tell = self.seen.graph, self.draw()
            try:
                tell()
            except RecipeError:
                assert self.seen.graph is before

    def draw(self) -> Callable[[], object]:
        """Return a report at random."""
        draw, seen, graph = self.random, self.seen, self.seen.graph
        room, thing = draw.choice(seen.rooms), draw.choice(THINGS)
        here = [o.name for o in graph.objects if o.room_index == seen.rooms.index(room) + 1]
        known = [obj.name for obj in graph.objects] or ["none"]
        sighting: dict[str, Any] = {
            "object_id": draw.choice([None, None, "a", "b", "c", draw.choice(known)]),
            "score": draw.choice([None, None, 0.0, 0.2, 0.6, 1.0]),
            "on": draw.choice([None, *here]),
            "stays": draw.choice([None, None, 1e-3, 1e6]),
            "within": draw.choice([0.0, 0.5, 0.5]),
        }
        steps = [-1e7, -50 * HOUR, -HOUR, 0, 0.123456789, draw.random() * HOUR, 30 * HOUR]
        time = draw.choice([None, (graph.now or 0.0) + draw.choice(steps)])
        if graph.now is None and draw.random() < 0.9:
            time = None
        seldom: list[Callable[[], object]] = [
            lambda: seen.searched(room, time=time),
            lambda: seen.searched(room, found=here[: len(here) // 2], time=time),
            lambda: seen.entered(room, hidden_share=0.5, time=time),
            lambda: seen.entered(room, floor_in_view=0.5, time=time),
            lambda: seen.passes(draw.choice([0, 5, 1000])),
            lambda: seen.keeps(draw.choice(["mug", "drinks"]), room=room, at=draw.choice(known)),
            lambda: seen.never("milk", at="cabinet"),
            lambda: seen.forget(draw.choice([None, "keys", "drinks"])),
            lambda: seen.describe(room, room_type=draw.choice(ROOMS)),
            lambda: seen.discovered(draw.choice(ROOMS), beside=room),
            lambda: seen.more_rooms(draw.choice([0, 1, True])),
        ]
        return draw.choice(
            [
                lambda: seen.saw(room, draw.choice(FURNITURE), time=time, within=0),
                lambda: seen.saw(room, thing, time=time, **sighting),
                lambda: seen.saw(room, thing, time=time, **sighting),
                lambda: seen.looked(room, thing, at=draw.choice([None, *here]), time=time),
                lambda: seen.gone(draw.choice(known), time=time),
                draw.choice(seldom),
            ]
        )


def answer(seen: SeenBuilding) -> list[Any]:
    """Return what is answered, with what must hold of any answer."""
    found: list[Any] = []
    for thing in ASKED:
        anywhere, places = seen.anywhere(thing), seen.where(thing)
        pieces = [piece for place in places for piece in place.pieces]
        some = [*places, *pieces]
        shares = [anywhere, *(s.probability for s in some), *(s.if_there for s in some)]
        assert all(0 <= share <= 1 + 1e-9 for share in shares), (thing, places)
        assert all(math.isfinite(p.expected) and p.expected >= 0 for p in places), (thing, places)
        assert anywhere >= max(p.probability for p in places) - 1e-9, (thing, places)
        for place in places:
            assert place.if_there == pytest.approx(min(1, place.probability / (anywhere or 1)))
        habits = seen.habits(thing)
        assert not habits or sum(habit.share for habit in habits) == pytest.approx(1)
        likely = {f"{p.room}": p.probability for p in places}
        likely |= {
            f"{p.room} {piece.piece}": piece.probability for p in places for piece in p.pieces
        }
        found += [anywhere, *(likely[name] for name in sorted(likely))]
    try:
        found.append(seen.next_room("mug", here=seen.rooms[0]))
    except RecipeError as error:  # no way leads to what is left
        found.append(error.code)
    return found


def is_same(first: list[Any], second: list[Any]) -> bool:
    numbers = [[n for n in some if isinstance(n, float)] for some in (first, second)]
    return first[-1] == second[-1] and numbers[0] == pytest.approx(numbers[1], abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_any_story_is_answered_and_saved(seed: int) -> None:
    story = Story(seed)
    for _ in range(8):
        story.go_on(8)
        document = json.loads(json.dumps(encode_robot_graph(story.seen.graph)))
        assert is_same(answer(story.seen), answer(open_graph(document, model=UNIVERSAL))), document


@pytest.mark.parametrize("seed", range(8, 12))
def test_what_is_forgotten_was_never_there(seed: int) -> None:
    """Of a graph without a clock, not even the times of its parts are heard."""
    story = Story(seed)
    story.go_on(60)
    graph = story.seen.graph
    story.seen.forget()
    never = replace(graph, memory=(), customs=())
    assert story.seen.graph == never
    assert answer(story.seen) == answer(SeenBuilding(never, UNIVERSAL))
    still = replace(never, now=None)
    timeless = replace(
        still,
        objects=tuple(replace(obj, time=None, stays=None) for obj in graph.objects),
        rooms=tuple(replace(room, time=None) for room in graph.rooms),
        looks=tuple(replace(look, time=None) for look in graph.looks),
    )
    remembering = replace(still, memory=graph.memory)
    answers = [answer(SeenBuilding(state, UNIVERSAL)) for state in (still, timeless, remembering)]
    assert answers[0] == answers[1] == answers[2]


@pytest.mark.parametrize("seed", range(12, 24))
def test_a_look_that_missed_makes_no_place_likelier(seed: int) -> None:
    story = Story(seed)
    story.go_on(50)
    seen = story.seen
    for thing in ("keys", "mug", "milk"):
        for room in seen.rooms:
            before = {p.room: p.probability for p in seen.where(thing)}[room]
            looked = seen.copy()
            looked.looked(room, thing)
            after = {p.room: p.probability for p in looked.where(thing)}[room]
            assert after <= before + 1e-9, (thing, room)
