from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY
from refusals import refuses

from bsg_data.errors import RecipeError, SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_models.belief.belief_graph import believe
from bsg_models.belief.hidden_share import estimate_hidden_share
from bsg_models.runs.found_model import find_shipped
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.place import EXPLORE
from bsg_robot.answers.seen_building import SeenBuilding, open_graph
from bsg_robot.graph.reports import reclassify
from bsg_robot.graph.robot_json import read_robot_graph
from bsg_robot.things.pieces import find_pieces_of

OFFICE = REPOSITORY / "docs" / "office.json"
FAST = Predictor("mixture")  # loaded once: it answers by counting


@pytest.fixture
def seen() -> SeenBuilding:
    """The office of the docs, as the fast shipped model sees it."""
    return SeenBuilding(read_robot_graph(OFFICE), FAST)


def test_answers_are_those_of_the_arrays(seen: SeenBuilding) -> None:
    belief, sink = seen.expectation(), FAST.classes.index("sink")
    for place in seen.where("sink"):
        node = 1 + seen.rooms.index(str(place.room))
        assert place.probability == pytest.approx(belief.presence[node, sink], abs=1e-12)
        assert place.expected == pytest.approx(belief.hidden[node, sink], abs=1e-12)
    assert seen.anywhere("sink") == pytest.approx(belief.presence[0, sink], abs=1e-12)
    hall = {expected.name: expected for expected in seen.expected("kitchen")}
    assert hall["sink"].probability == belief.presence[2, sink]
    assert hall["chair"].seen == 2
    assert seen.belief() == believe(
        seen.graph,
        belief,
        model="mixture",
        piece_of=find_pieces_of(seen.graph, belief.presence),
    )


def test_answers_say_what_a_person_would_find_and_models_what_annotators_noted() -> None:
    """Few annotators of a home wrote down its bags; nearly every home has one."""
    rooms = {"kitchen": [], "hall": [], "bedroom": [], "bathroom": [], "living room": []}
    home = open_graph(rooms, model=FAST)
    bag, sink = FAST.classes.index("bag"), FAST.classes.index("sink")
    noted, found = FAST(home.graph).presence, home.expectation().presence
    assert noted[0, bag] + 0.03 < found[0, bag] == pytest.approx(home.anywhere("bag"))
    assert found[0, sink] == pytest.approx(noted[0, sink], abs=0.03)
    assert found[1:, sink].argmax() == noted[1:, sink].argmax()


def test_a_room_hides_what_the_look_at_it_leaves(seen: SeenBuilding) -> None:
    seen.entered("kitchen", floor_in_view=0.75)
    assert seen.graph.rooms[1].share == estimate_hidden_share(floor_in_view=0.75)
    seen.entered("kitchen")
    assert seen.graph.rooms[1].share == estimate_hidden_share(floor_in_view=0.75)
    with refuses(RecipeError, "share-twice", "kitchen"):
        seen.entered("kitchen", floor_in_view=0.75, hidden_share=0.5)


def test_words_of_the_user_are_read_from_a_table(tmp_path: Path) -> None:
    table = tmp_path / "words.csv"
    table.write_text("source_label,label\nKajüte,bedroom\n", "utf-8")
    seen = open_graph({"Kajüte 1": []}, room_labels=table)
    seen.discovered("R9")
    seen.describe("R9", room_type="kajüte")
    assert [room.room_type for room in seen.graph.rooms] == ["bedroom", "bedroom"]
    table.write_text("source_label,label\nKajüte,bedrom\n", "utf-8")
    with refuses(SourceError, "room-label-unknown", f"{table}, line 2"):
        open_graph({}, room_labels=table)


def test_the_way_to_a_room_without_a_place_is_unknown(seen: SeenBuilding) -> None:
    seen.discovered("attic")
    costs = {place.room: place.cost for place in seen.where("stove", here="kitchen")}
    assert costs.pop("attic") is None
    assert None not in costs.values()
    from_there = {place.room: place.cost for place in seen.where("stove", here="attic")}
    assert from_there == {**dict.fromkeys(costs), "attic": 0}
    given = {("attic", "kitchen"): 2.0}
    assert {p.room: p.cost for p in seen.where("stove", here="kitchen", costs=given)}["attic"] == 2
    for wrong in ({("kitchen", "attic"): float("nan")}, {("attic", "attic"): 1.0}):
        with pytest.raises(RecipeError, match="costs: "):
            seen.where("stove", costs=wrong)


@pytest.mark.parametrize(
    "tell",
    [
        lambda seen: seen.saw("kitchen", ""),
        lambda seen: seen.discovered("attic", floor_area=-5.0),
        lambda seen: seen.discovered("attic", beside="cellar"),
        lambda seen: seen.discovered("attic", room_type={"kitchen": 2}),
        lambda seen: seen.entered("kitchen", floor_in_view="x"),
        lambda seen: seen.saw("kitchen", "cup", score=1.5),
        lambda seen: seen.saw("kitchen", "cup", time=1.0, age=1.0),
        lambda seen: seen.saw("kitchen", "cup", time="2026-11-28T08:00:00"),  # of which zone?
        lambda seen: seen.passes(-1.0),
        lambda seen: seen.passes(),
        lambda seen: seen.keeps("cup"),
        lambda seen: seen.never("zzqx", room="kitchen"),
        lambda seen: seen.saw("kitchen", "cup", age=-1.0, stays=2.0),
        lambda seen: seen.saw("kitchen", 3),
        lambda seen: seen.looked("kitchen", "cup", chance=1.2),
        lambda seen: seen.looked("kitchen", "zzqx"),
        lambda seen: seen.gone("no such id"),
        lambda seen: seen.searched("kitchen", found=["sofa"]),  # that is in another room
        lambda seen: seen.describe("kitchen", floor_area=-1.0),
        lambda seen: seen.describe("kitchen", beside="kitchen"),
        lambda seen: seen.more_rooms(-1),
        lambda seen: seen.where(["cup"]),
    ],
)
def test_what_cannot_be_is_refused_and_changes_nothing(
    seen: SeenBuilding, tell: Callable[[Any], object]
) -> None:
    before = seen.graph
    with pytest.raises(RecipeError):
        tell(seen)
    assert seen.graph is before


def test_threads_may_tell_and_ask_at_once(seen: SeenBuilding) -> None:
    def tell(robot: int) -> int:
        for number in range(40):
            seen.saw("kitchen", "chair", object_id=f"{robot} {number}")
        return len(seen.where("chair"))

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(tell, range(3))) == [3, 3, 3]
    assert len(seen.graph.objects) == 18 + 3 * 40


def test_a_word_beyond_the_model_is_asked_of_the_table_of_things(seen: SeenBuilding) -> None:
    """And of no other model: one home, one scale."""
    wide = load_class_map("hm3d-wide-v1").classes
    asked = {name: seen.asked(name) for name in wide}
    assert {*asked.values()} == {"mixture", "things-v1"}
    assert {name for name, by in asked.items() if by == "mixture"} <= {*FAST.classes}
    assert seen.asked("shoes") == seen.asked("pitchfork") == "things-v1"
    assert seen.next_room(["sink", "shoes"], here="waiting-room") in seen.rooms
    with refuses(RecipeError, "thing-unknown", "wall"):
        seen.where("wall")
    with refuses(RecipeError, "things-none"):
        seen.next_room([])


@pytest.mark.parametrize("how", ["name", "copy"])
def test_a_model_for_any_use_is_not_helped_by_one_for_research(how: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    shutil.copy(find_shipped("open"), tmp_path / "mine.safetensors")
    models = {
        "name": "open",
        "copy": tmp_path / "folder" / ".." / "mine.safetensors",
    }
    seen = open_graph(OFFICE, model=models[how])
    assert seen.asked("shoes") == "things-v1", "the table of things is free, too"
    with refuses(RecipeError, "thing-unknown", "sextant"):
        seen.where("sextant")


def test_the_model_for_any_use_knows_the_rooms_of_a_home_by_name_and_by_their_things() -> None:
    names = ("hall", "kitchen", "laundry", "bath", "bedroom", "living room")
    home = {"scene_id": "home", "rooms": [{"id": name, "visited": False} for name in names]}
    firsts = "microwave: kitchen, washing machine: laundry, bed: bedroom, toilet: bath"
    seen = open_graph(home, model="open")
    for thing, first in (row.split(": ") for row in f"{firsts}, tv: living room".split(", ")):
        assert seen.where(thing)[0].room == first
        assert seen.anywhere(thing) > 0.7
    rooms = {"R0": ["stove", "refrigerator"], "R1": ["bed", "wardrobe"], "R2": ["toilet", "shower"]}
    seen = open_graph({"R3": []} | rooms, model="open")
    for thing, first in (("microwave", "R0"), ("pillow", "R1"), ("bathtub", "R2")):
        assert seen.where(thing)[0].room == first


@pytest.mark.parametrize(("thing", "by"), [("banana", "things-v1"), ("cabbage leaf", "mixture")])
def test_a_thing_that_no_model_counts_is_judged_and_found(
    seen: SeenBuilding, thing: str, by: str
) -> None:
    meaning = seen.understand(thing)
    assert meaning.class_name is None
    assert (meaning.thing is None) == (by == "mixture")
    places = seen.where(thing)
    assert places[0].room == "kitchen" == seen.next_room(thing)
    assert 0 < places[0].probability <= seen.anywhere(thing) < 1
    assert seen.asked(thing) == by
    seen.saw("meeting-room", f"{thing}s".title(), object_id="b")
    first = seen.where(thing)[0]
    assert (first.room, first.probability, first.seen) == ("meeting-room", 1.0, ("b",))
    assert seen.next_room(thing) == "meeting-room"


@pytest.mark.parametrize(
    "words",
    [
        ("garbage bin", "bin", "GarbageCan", "trash can", "waste basket", "garbge bin"),
        ("tv", "telly", "television set", "tv screen", "tv_monitor"),
        ("toilet paper", "toilet roll", "loo roll", "tolet roll", "ToiletPaper_1"),
        ("remote control", "remote contrl", "RemoteControl"),
        ("air fryer", "AirFryer", "airfryer", "AirFryer_2", "air-fryer"),
        ("egg", "eggs", "box of eggs", "BoxOfEggs"),
        ("toothbrush", "toothbrsh", "the toothbrush"),
        ("vacuum cleaner", "vaccum cleaner", "hoover"),
        ("couch", "sofa", "settee"),
        ("defibrillator", "defib", "AED", "defibrilator"),
    ],
)
def test_all_spellings_of_a_thing_get_one_answer(words: tuple[str, ...]) -> None:
    """In a question, and for what was seen under any other of them."""
    rooms = {"kitchen": [], "living room": [], "bathroom": [], "bedroom": [], "hall": []}
    model = Predictor()
    empty = open_graph(rooms, model=model)
    first, *others = [[(p.room, p.probability) for p in empty.where(word)] for word in words]
    assert all(other == first for other in others)
    for spelling in words:
        seen = open_graph({**rooms, "hall": [spelling]}, model=model)
        assert {seen.where(word)[0].probability for word in words} == {1.0}, spelling
        assert not [note for note in seen.notes if "ignored" in note]


@pytest.mark.parametrize(
    ("narrow", "wide", "room"),
    [("wallet", "bag", "hall"), ("tie", "clothes", "bedroom"), ("cot", "double bed", "bedroom")],
)
def test_a_wider_thing_is_not_the_narrow_one(narrow: str, wide: str, room: str) -> None:
    """A double bed is no cot, and a wallet is not where bags are."""
    seen = open_graph({"hall": [], "bedroom": [wide], "kitchen": [], "utility room": [wide]})
    places = seen.where(narrow)
    assert places[0].room == room
    assert not any(place.seen for place in places)


def test_a_seen_thing_of_the_class_is_not_the_kind(seen: SeenBuilding) -> None:
    seen.saw("kitchen", "plate")
    assert seen.where("fork")[0].probability < 1
    seen.saw("kitchen", "forks", object_id="f")
    assert (seen.where("fork")[0].probability, seen.where("fork")[0].seen) == (1, ("f",))


def test_another_class_space_asks_the_default_model_for_nouns() -> None:
    wide = SeenBuilding(
        reclassify(read_robot_graph(OFFICE), load_class_map("hm3d-wide-v1")), "universal-wide"
    )
    same = open_graph(OFFICE)
    assert wide.asked("sextant") == "universal"
    of_wide, of_same = (
        [replace(place, pieces=()) for place in home.where("sextant")] for home in (wide, same)
    )
    assert of_wide == of_same


def test_a_word_names_all_known_objects_of_its_kind(seen: SeenBuilding) -> None:
    seen.saw("kitchen", "mug", object_id="m1")
    seen.saw("kitchen", "red mug", object_id="m2")
    seen.searched("kitchen", found="mugs")
    assert {obj.name for obj in seen.graph.objects if obj.room_index == 2} == {"m1", "m2"}


def test_a_file_may_say_looks_and_objects_without_scores(seen: SeenBuilding) -> None:
    """A look lowers what was said, by Bayes' rule, whoever says it."""
    home = {"kitchen": ["mug"], "hall": ["chair"], "bath": []}
    plain = open_graph(home, model="mixture")
    plain.looked("kitchen", "mug", chance=0.5)
    document: dict[str, Any] = {
        "scene_id": "graph",
        "rooms": [{"id": "kitchen"}, {"id": "hall"}, {"id": "bath", "visited": False}],
        "objects": [{"id": "mug 1", "room": "kitchen", "category": "mug"}],
        "looks": [{"room": "kitchen", "thing": "mug", "chance": 0.5}],
    }
    looked = open_graph(document, model="mixture")
    document["objects"][0]["score"] = 0.25
    scored = open_graph(document, model="mixture")
    found = []
    for state in (plain, looked, scored):
        place = next(p for p in state.where("mug") if p.room == "kitchen")
        found.append(1 - (1 - place.probability) / (1 - place.unseen))
    assert found == pytest.approx([0.4 / 0.6, 0.4 / 0.6, 0.125 / 0.875])


def test_rooms_that_are_found_are_fewer_that_are_not_found_yet() -> None:
    seen = open_graph({"hall": ["mirror"], "more_rooms": True})
    assert [place.room for place in seen.where("towel")] == [EXPLORE, "hall"]
    assert seen.next_room("towel") == EXPLORE
    usual = seen.anywhere("towel")
    seen.more_rooms(2)
    assert seen.anywhere("towel") < usual
    seen.discovered("cellar", beside="hall")
    assert seen.graph.more_rooms == 1
    seen.more_rooms(0)
    assert {place.room for place in seen.where("towel")} == {"hall", "cellar"}
    with refuses(RecipeError, "room-named-explore", "explore"):
        seen.discovered("explore")


def test_thirty_sightings_at_one_place_are_one_sofa(seen: SeenBuilding) -> None:
    before = len(seen.graph.objects)
    ids = {seen.saw("kitchen", "sofa", position=(5.0, 5.0 + k / 100, 0.0)) for k in range(30)}
    assert len(ids) == 1
    assert len(seen.graph.objects) == before + 1
    assert seen.saw("kitchen", "couch", position=(5.0, 5.2, 0.0)) in ids
    assert seen.saw("kitchen", "armchair", position=(5.0, 5.2, 0.0)) not in ids
    assert seen.saw("kitchen", "sofa", position=(5.0, 9.0, 0.0)) not in ids
    assert seen.saw("kitchen", "sofa", position=(5.0, 5.0, 0.0), within=0) not in ids


def test_yesterdays_sighting_fades() -> None:
    rooms = [{"id": room, "visited": False} for room in ("hall", "bathroom", "kitchen")]
    seen = open_graph({"scene_id": "home", "rooms": rooms, "more_rooms": 0})
    seen.never("umbrella", room="bathroom")
    seen.saw("bathroom", "umbrella", age=24.0, stays=24.0)
    place = next(p for p in seen.where("umbrella") if p.room == "bathroom")
    # Half of them are elsewhere, 97 % of these in this home; a sighting of yesterday at this hour
    # weighs (2^(-1/20) + 2^(-1/4)) / 2 * (0.6 + 2) = 2.35, a twentieth of it where people say
    # never; all other rooms weigh 0.5. A second umbrella may be there, too, though hardly.
    alone = 0.5 + 0.5 * 0.97 * 0.117 / 0.617
    assert alone < place.probability < alone + 0.03
    assert seen.anywhere("umbrella") > 0.95


def test_more_is_learned_of_a_room_later(seen: SeenBuilding) -> None:
    seen.discovered("x", beside="kitchen")
    seen.describe("x", room_type="bathroom", label="the bath", floor_area=6.0)
    room = seen.graph.rooms[-1]
    assert (room.room_type, room.label, room.floor_area) == ("bathroom", "the bath", 6.0)
    seen.describe("the bath", beside="meeting-room")
    assert len([pair for pair in seen.graph.adjacency if 4 in pair]) == 2


def test_a_robot_can_say_what_its_looks_cost(seen: SeenBuilding) -> None:
    first = seen.next_room("sink", here="waiting-room", look=5.0)
    dear = seen.next_room("sink", here="waiting-room", look={str(first): 1000.0})
    assert dear != first
    for look in (-1.0, float("inf"), {"kitchen": -1}, {"attic": 1}, "x"):
        with pytest.raises(RecipeError):
            seen.next_room("sink", here="waiting-room", look=look)  # type: ignore[arg-type]
    with refuses(RecipeError, "chance-zero"):
        seen.next_room("sink", here="waiting-room", chance=0)
    with refuses(RecipeError, "robots-none"):
        seen.next_rooms({}, "sink")
    with pytest.raises(RecipeError):
        seen.next_rooms({"a": "attic"}, "sink")


def test_a_look_that_sees_nothing_and_a_doubtful_sighting_change_no_look(
    seen: SeenBuilding,
) -> None:
    before = seen.where("mug")
    seen.looked("kitchen", "mug", chance=0)
    assert seen.where("mug") == before
    seen.looked("kitchen", "mug")
    seen.saw("kitchen", "mug", score=0.05)
    assert seen.graph.looks[-1].chance == 0.8


@pytest.mark.parametrize(
    ("part", "whole"),
    [("air mattress", "bed"), ("wallet", "bag")],
)
def test_a_look_for_one_thing_says_nothing_of_the_rest_of_its_class(part: str, whole: str) -> None:
    home = {"bedroom": ["sofa"], "kitchen": ["sink"], "hall": []}
    before, seen = open_graph(home), open_graph(home)
    seen.looked("bedroom", part, chance=0.9)
    assert seen.where(whole) == before.where(whole)
    assert seen.expected("bedroom") == before.expected("bedroom")
    assert seen.anywhere(part) < before.anywhere(part)


def test_a_look_that_a_model_has_no_word_for_is_a_note() -> None:
    home = {"scene_id": "x", "rooms": [{"id": "a"}], "looks": [{"room": "a", "thing": "sextant"}]}
    seen = open_graph(home, model="open")
    assert any("sextant" in note for note in seen.notes)
    assert 0 < seen.where("chair")[0].probability < 1


def test_one_thing_in_two_words_is_one_thing(seen: SeenBuilding) -> None:
    asked = {"here": "kitchen", "look": 5.0}
    assert seen.explain(["sofa", "couch"], **asked) == seen.explain("couch", **asked)


def test_the_building_believes_what_its_rooms_do_after_looks(seen: SeenBuilding) -> None:
    sink = FAST.classes.index("sink")
    for room in ("kitchen", "meeting-room"):
        seen.looked(room, "sink", chance=0.7)
    assert seen.expectation().presence[0, sink] == pytest.approx(seen.anywhere("sink"), rel=1e-6)


@pytest.mark.parametrize("model", ["mixture", "universal"])
def test_a_room_that_hides_all_but_what_was_seen_is_as_one_that_hides_nearly_all(
    model: str,
) -> None:
    """Something was seen there, so it was looked into, whatever was said."""
    predictor = Predictor(model)

    def ask(share: float) -> list[float]:
        rooms = [
            {"id": "kitchen", "hidden_share": share},
            {"id": "bedroom", "hidden_share": 0.4},
            {"id": "bathroom", "visited": False},
        ]
        words = [("sink", "kitchen"), ("stove", "kitchen"), ("bed", "bedroom")]
        objects = [
            {"id": str(number), "category": word, "room": room}
            for number, (word, room) in enumerate(words)
        ]
        seen = open_graph({"scene_id": "a", "rooms": rooms, "objects": objects}, model=predictor)
        return [float(chance) for chance in seen.expectation().presence.ravel()]

    assert ask(1) == pytest.approx(ask(0.99), abs=0.01)
    assert ask(0.99) != pytest.approx(ask(0.5), abs=0.01)
