"""Notes on how a graph is read: each is there for what was told, and only then."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bsg_models.runs.predictor import Predictor
from bsg_models.zoo.catalogue import ZOO
from bsg_robot.answers.kind_table import read_kinds
from bsg_robot.answers.kinds import infer_kinds
from bsg_robot.answers.notes import note_graph
from bsg_robot.answers.seen_building import open_graph
from bsg_robot.graph.robot_json import parse_robot_graph


@pytest.fixture(scope="module")
def universal() -> Predictor:
    return Predictor()


def notes_on(
    predictor: Predictor, room: dict[str, Any], *words: str, **facts: Any
) -> tuple[str, ...]:
    said = {
        "scene_id": "home",
        "rooms": [{"id": "R1", "hidden_share": 0.5, **room}],
        "more_rooms": 0,
        "objects": [{"id": str(n), "room": "R1", "category": w} for n, w in enumerate(words)],
        **facts,
    }
    graph = parse_robot_graph(said, path=Path("x"), class_map=predictor.class_map)
    return tuple(note_graph(graph, predictor, infer_kinds(graph, read_kinds())))


def test_a_graph_that_says_all_has_no_note(universal: Predictor) -> None:
    assert notes_on(universal, {}, "sink", "wall", source="hm3d", detector=["sink"]) == ()
    assert notes_on(universal, {"hidden_share": None, "floor_in_view": 0.6}, "sink") == ()


@pytest.mark.parametrize(
    ("room", "words", "facts", "named"),
    [
        ({"hidden_share": None}, (), {}, "R1"),
        ({"room_type": "staff kitchen"}, (), {}, "'staff kitchen' is kitchen (head noun)"),
        ({}, ("zzqx thing",), {}, "'zzqx thing'"),
        ({}, ("blue velvet sofa",), {}, "'blue velvet sofa' is "),
        ({}, ("",), {}, "(no name): not among the 45 classes; the model does not read them"),
        ({}, (), {"source": "my robot"}, "'my robot'"),
        ({}, (), {"detector": ["sink", "flibber"]}, "flibber"),
    ],
)
def test_what_is_not_understood_is_named_once(
    universal: Predictor,
    room: dict[str, Any],
    words: tuple[str, ...],
    facts: dict[str, Any],
    named: str,
) -> None:
    notes = notes_on(universal, room, *words, **facts)
    (note,) = (note for note in notes if not note.startswith("taken for a building"))
    assert named in note


def test_a_word_without_a_class_is_evidence_for_models_that_read_it(universal: Predictor) -> None:
    (read,) = notes_on(universal, {}, "coat rack", "coat rack", "sink")
    (ignored,) = notes_on(Predictor("mixture"), {}, "coat rack", "sink")
    assert "coat rack" in universal.vocabulary
    assert read.replace("universal", "mixture") != ignored
    assert read.count("coat rack") == ignored.count("coat rack") == 1


OFFICE = {
    "R0": ["whiteboard", "projector", "conference table"],
    "R1": ["desk", "office chair", "keyboard"],
    "R2": ["photocopier", "printer", "paper shredder"],
    "R3": ["server rack", "network switch"],
    "R4": ["urinal", "hand dryer"],
}
SMALL = {"office": ["desk"], "meeting room": [], "building_kind": "office"}
NO_NAMES = {"R0": ["stove", "fridge"], "R1": ["bed", "wardrobe"], "bath": ["toilet"], "R3": []}
LACKING = (
    "more rooms are expected, not found yet: a home has a kitchen, a bathroom and a bedroom; "
    "say `more_rooms: 0` if the map is whole, or the `building_kind`"
)
DOUBTED = "called kitchen, but its things are those of: bathroom"


@pytest.mark.parametrize(
    ("said", "note"),
    [
        (SMALL, "office, meeting room: taken as the whole building"),
        ({"hall": [], "kitchen": []}, LACKING),
        ({"kitchen": [], "bathroom": [], "hall": [], "office": []}, LACKING),
        (OFFICE, "taken for a building of the kind office, by its rooms; say `building_"),
        (NO_NAMES, "R0 as kitchen, R1 as bedroom: read by what was seen; say `room_type`"),
        ({"kitchen": ["bed", "toilet", "shower"]}, DOUBTED),
    ],
)
def test_what_a_map_is_taken_for_is_said(said: dict[str, Any], note: str) -> None:
    assert sum(note in said for said in open_graph(said).notes) == 1


WHOLE = {"kitchen": NO_NAMES["R0"], "bedroom": NO_NAMES["R1"], "bath": [], "R3": []}


@pytest.mark.parametrize(
    ("said", "note"),
    [
        ({"hall": [], "more_rooms": True}, "whole"),
        ({"office": [], "meeting room": [], "lobby": []}, "whole"),
        ({"hall": [], "kitchen": [], "more_rooms": 0}, "not found yet"),
        ({"kitchen": [], "bathroom": [], "bedroom": []}, "not found yet"),
        ({**OFFICE, "building_kind": "office"}, "taken for a building"),
        (WHOLE, "taken for a building"),
        (WHOLE, "read by"),
        *(({"kitchen": things}, "called") for things in (["stove", "sink"], ["bed", "toilet"], [])),
    ],
)
def test_and_nothing_where_it_is_plain(said: dict[str, Any], note: str) -> None:
    assert not any(note in said for said in open_graph(said).notes)


def test_rooms_that_are_found_are_understood_as_those_of_a_map() -> None:
    seen = open_graph({"more_rooms": True})
    for name in ("patient room 1", "nurse station", "kitchens", "zzqx"):
        seen.discovered(name)
    kinds = ["patient room", "office", "kitchen", None]
    assert [room.room_type for room in seen.graph.rooms] == kinds
    assert seen.graph.building_kind == "hospital"
    seen.describe("zzqx", label="Dispensary")
    seen.describe("kitchens", room_type="bar")
    assert [room.room_type for room in seen.graph.rooms] == [*kinds[:2], "bar", "pharmacy"]
    seen.saw("zzqx", "coat rack")
    named = "patient room 1, nurse station, Dispensary: read as the kinds that their names say"
    assert named in seen.notes
    assert any("coat rack" in note for note in seen.notes), "what came later is told, too"


def test_a_model_that_reads_no_room_types_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ZOO["mixture"].make, "reads_labels", False)
    (note,) = notes_on(Predictor("mixture"), {"room_type": "kitchen"}, "sink")
    assert note == "room types: mixture does not read them"
