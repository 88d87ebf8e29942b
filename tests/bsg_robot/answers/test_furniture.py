"""Pieces of furniture: by hand, after looks, and as a person would look."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_models.belief.partial_graph import KnownRoom, SeenObject
from bsg_models.search.looks import PIECE, miss_all
from bsg_robot.answers.place import NOT_SEEN, Destination, Piece
from bsg_robot.answers.seen_building import SeenBuilding, open_graph
from bsg_robot.errors import BeliefFileError
from bsg_robot.graph.document import decode_belief, encode_belief, to_networkx
from bsg_robot.graph.formats import read_belief, write_belief
from bsg_robot.things.pieces import find_pieces, furnish
from bsg_robot.things.things import find_keeping, find_receptacle, read_shares

FLAT: dict[str, Any] = {
    "scene_id": "flat",
    "building_kind": "home",
    "rooms": [
        {"id": "kitchen", "floor_in_view": 0.9, "position": [0, 0, 0]},
        {"id": "living room", "floor_in_view": 0.8, "position": [5, 0, 0]},
        {"id": "bedroom", "floor_in_view": 0.7, "position": [5, 5, 0]},
        {"id": "bathroom", "visited": False, "position": [0, 5, 0]},
    ],
    "objects": [
        {"id": "cup", "room": "kitchen", "category": "mug", "on": "counter"},
        *(
            {"id": name, "room": room, "category": category, "position": [x, y, 0]}
            for name, room, category, x, y in (
                ("counter", "kitchen", "counter", -1, 0),
                ("fridge", "kitchen", "refrigerator", 1, 1),
                ("upper", "kitchen", "upper cabinet", -1, 1),
                ("lower", "kitchen", "lower cabinet", -1, 1),
                ("sofa", "living room", "sofa", 6, 0),
                ("low", "living room", "coffee table", 5, 1),
                ("books", "living room", "bookshelf", 4, -1),
                ("bed", "bedroom", "bed", 6, 6),
                ("wardrobe", "bedroom", "wardrobe", 4, 6),
            )
        ),
    ],
    "adjacency": [["kitchen", "living room"], ["living room", "bedroom"], ["kitchen", "bathroom"]],
}


def flat() -> SeenBuilding:
    return open_graph(FLAT)


FIRST = {
    "kitchen": "milk: fridge, banana: counter, plate: upper, frying pan: lower, mug: counter",
    "living room": "remote control: low, cushion: sofa, book: books",
    "bedroom": "pillow: bed, socks: wardrobe",
}


@pytest.mark.parametrize("room", FIRST)
def test_a_person_would_look_there_first(room: str) -> None:
    seen = flat()  # a mug was seen on the counter
    for thing, piece in (row.split(": ") for row in FIRST[room].split(", ")):
        assert seen.where(thing, within=room)[0].piece == piece, thing


def test_the_rates_by_hand() -> None:
    """Two pieces that were seen, one class that is expected, half of the room hidden."""
    room = KnownRoom("k", hidden_share=0.5, room_type="kitchen")
    objects = [SeenObject(w, 1, w, None, None) for w in ("counter", "refrigerator", "spoon")]
    unseen = np.array([0, 0.4])
    found = furnish("milk", room, find_pieces(objects), classes=("couch", "sink"), unseen=unseen)
    shares, keeping = read_shares(), find_keeping("milk")
    assert found is not None
    assert keeping is not None
    people = 0.5 * (shares.belongs + shares.untidy)[shares.rooms.index("kitchen")]
    counter, fridge, sink = (
        people[kind.like[0]]
        * (keeping.weights.get(kind.name, 0) + (0.3 if kind.only else 3)) ** 0.8
        for w in ("counter", "fridge", "sink")
        if (kind := find_receptacle(w))
    )
    expected = np.array([counter * 0.75, fridge, sink * 0.4 * 0.2])  # it was inside the room
    np.testing.assert_allclose(found.rates, expected)
    np.testing.assert_allclose(found.shares({}), expected / expected.sum())
    after = expected * [1, 0.2, 1]
    np.testing.assert_allclose(found.shares({"refrigerator": 0.2}), after / after.sum())
    assert found.overlooked({"refrigerator": 0.2}) == pytest.approx(after.sum() / expected.sum())


def test_shares_of_a_room_add_up_and_what_was_seen_is_there() -> None:
    pieces = flat().where("mug", within="kitchen")
    assert sum(piece.if_there for piece in pieces) == pytest.approx(1)
    assert pieces[0] == Piece("counter", "counter", 1.0, pieces[0].if_there, ("cup",))
    assert pieces[-1].name == NOT_SEEN
    assert pieces[-1].piece is None
    assert flat().where("wardrobe", within="bedroom") == ()
    best = {place.room: place.pieces for place in flat().where("milk")}
    assert best["kitchen"][0].piece == "fridge"
    assert best["bathroom"] == ()


def test_a_look_at_a_piece_moves_the_belief_to_the_others_by_bayes_rule() -> None:
    seen = flat()
    before = {piece.piece: piece.if_there for piece in seen.where("milk", within="kitchen")}
    room = seen.where("milk")[0].unseen
    seen.looked("kitchen", "milk", at="fridge", chance=0.9)
    after = {piece.piece: piece.if_there for piece in seen.where("milk", within="kitchen")}
    missed = 1 - 0.9 * before["fridge"]
    assert after["fridge"] == pytest.approx(0.1 * before["fridge"] / missed)
    assert after["upper"] == pytest.approx(before["upper"] / missed)
    assert seen.where("milk")[0].unseen < room
    assert {piece.piece: piece.if_there for piece in seen.where("cheese", within="kitchen")}[
        "fridge"
    ] == pytest.approx(before["fridge"])


def test_tidy_and_untidy_homes_differ() -> None:
    tidy, untidy = (
        {
            piece.piece: piece.if_there
            for piece in flat().where("book", within="living room", tidy=t)
        }
        for t in (1.0, 0.0)
    )
    assert tidy["books"] > untidy["books"], "where it belongs"
    assert tidy["sofa"] < untidy["sofa"], "where it was left"
    with pytest.raises(RecipeError):
        flat().where("book", within="living room", tidy=1.5)


def test_the_search_goes_from_piece_to_piece() -> None:
    seen, here, at, stops = flat(), "living room", None, list[Destination]()
    for _ in range(4):
        go = seen.next_place("milk", here=here, at=at)
        assert go is not None
        stops.append(go)
        here, at = go.room, go.piece
        seen.looked(here, "milk", at=at)
    assert stops[0] == Destination("kitchen", "fridge")
    assert len(set(stops)) == len(stops)
    assert seen.anywhere("milk") < flat().anywhere("milk")


def test_a_piece_that_is_gone_holds_nothing() -> None:
    seen = flat()
    seen.looked("kitchen", "milk", at="counter")
    spoon = seen.saw("kitchen", "spoon", on="counter")
    seen.gone("counter")
    assert {obj.name: obj.on for obj in seen.graph.objects}[spoon] is None
    (look,) = seen.graph.looks  # it was a look into the room, at the share of the counter
    assert look.at is None
    assert 0 < look.chance < 0.3


def test_a_look_counts_though_the_piece_is_gone() -> None:
    seen = flat()
    milk = seen.saw("kitchen", "milk", on="fridge")
    for _ in range(3):
        seen.looked("kitchen", "milk", at="fridge")
    doubted = seen.where("milk")[0].probability
    seen.gone("fridge")
    assert seen.where("milk")[0].probability == pytest.approx(doubted, abs=0.05)
    (score,) = (obj.score for obj in seen.graph.objects if obj.name == milk)
    missed = miss_all([0.8] * 3, overlooked=PIECE)
    assert score == pytest.approx(0.8 * missed / (0.2 + 0.8 * missed))


def test_what_is_seen_again_stays_where_it_lay() -> None:
    seen = flat()
    seen.saw("kitchen", "mug", object_id="cup")
    assert {obj.name: obj.on for obj in seen.graph.objects}["cup"] == "counter"
    seen.saw("bedroom", "mug", object_id="cup")
    assert {obj.name: obj.on for obj in seen.graph.objects}["cup"] is None


def test_a_mug_on_a_tray_on_the_counter_is_at_the_counter() -> None:
    seen = flat()
    seen.saw("kitchen", "tray", object_id="tray", on="counter")
    seen.saw("kitchen", "plate", object_id="plate", on="tray")
    assert seen.where("plate", within="kitchen")[0].seen == ("plate",)
    with refuses(RecipeError, "piece-on-itself", where="tray"):
        seen.saw("kitchen", "tray", object_id="tray", on="plate")


def test_one_chair_is_not_searched_before_the_kitchen() -> None:
    seen = open_graph({"kitchen": ["chair"] * 6, "hall": ["coat rack"]})
    seen.entered("kitchen", floor_in_view=0.2)
    assert seen.next_place("milk", here="hall") == Destination("kitchen", None)
    rooms = [{"id": "kitchen", "visited": False}, {"id": "hall", "visited": True}]
    chair = {"id": "chair", "room": "kitchen", "category": "chair"}
    seen = open_graph({"scene_id": "a", "rooms": rooms, "objects": [chair]})
    assert seen.next_place("milk", here="hall") == Destination("kitchen", None)


def test_furniture_in_other_words_is_furniture() -> None:
    seen = open_graph({"kitchen": ["white cabinet", "wooden table", "fridge_2"], "hall": []})
    known = {piece.name for piece in seen.where("mug", within="kitchen")}
    assert known == {"white cabinet", "wooden table", "fridge_2", NOT_SEEN}
    with refuses(RecipeError, "piece-holds-nothing", where="spoon"):
        seen.saw("kitchen", "spoon", object_id="spoon")
        seen.looked("kitchen", "mug", at="spoon")


def test_looks_at_every_piece_leave_little_of_what_was_seen_on_none_of_them() -> None:
    seen = open_graph({"kitchen": ["fridge", "counter", "cup"], "hall": []})
    before = seen.where("cup")[0].probability
    for piece in ("fridge 1", "counter 1"):
        seen.looked("kitchen", "cup", at=piece, chance=1.0)
    (cup,) = [obj for obj in seen.graph.objects if obj.raw_category == "cup"]
    assert before == 1
    assert cup.name not in seen.where("cup")[0].seen


def test_a_piece_is_named_by_its_id_or_its_word() -> None:
    seen = flat()
    seen.looked("kitchen", "milk", at="refrigerator")
    assert [look.at for look in seen.graph.looks] == ["fridge"]
    with refuses(RecipeError, "piece-unknown", where="sofa"):
        seen.looked("kitchen", "milk", at="sofa")
    with refuses(RecipeError, "piece-on-itself", where="cup"):
        seen.saw("kitchen", "mug", object_id="cup", on="cup")


def test_blind_nodes_are_on_their_likeliest_piece_and_are_written_and_read(tmp_path: Path) -> None:
    belief = flat().belief()
    classes = belief.partial.class_space.classes
    on = {(classes[node.class_index], node.room_index): node.on for node in belief.blind}
    assert on["pillow", 3] == "bed"
    assert on.get(("bed", 3)) is None, "it stands by itself"
    assert all(node.on is None for node in belief.blind if node.room_index == 4), "nobody was there"
    write_belief(belief, tmp_path / "belief.json")
    assert read_belief(tmp_path / "belief.json") == belief
    graph = to_networkx(belief)
    lying = {
        (graph.nodes[a].get("id", graph.nodes[a].get("class")), graph.nodes[b]["id"])
        for a, b, kind in graph.edges(data="kind")
        if kind == "on"
    }
    assert ("cup", "counter") in lying
    assert ("pillow", "bed") in lying
    document = encode_belief(belief)
    document["blind"][0]["on"] = "sofa" if document["blind"][0]["room"] != 2 else "bed"
    with pytest.raises(BeliefFileError, match="which is not in its room"):
        decode_belief(document, path=Path("x"))


def test_of_hundreds_of_pieces_that_of_the_robot_is_weighed_too() -> None:
    rooms = [{"id": f"r{n}", "room_type": "office", "position": [n, 0, 0]} for n in range(60)]
    objects = [
        {"id": f"{n} {k}", "room": f"r{n}", "category": word, "position": [n, k, 0]}
        for n in range(60)
        for k, word in enumerate(("desk", "garbage bin", "shelf", "chair"))
    ]
    seen = open_graph({"scene_id": "a", "rooms": rooms, "objects": objects})
    assert seen.next_place("stapler", here="r0", at="0 1") == Destination("r0", "0 0")


def test_what_was_seen_in_the_room_is_on_a_piece_that_was_seen_there() -> None:
    seen = open_graph({"kitchen": ["fridge", "counter", "cup"], "hall": ["coat rack"]})
    pieces = seen.where("cup", within="kitchen")
    unseen = next(place for place in seen.where("cup") if place.room == "kitchen").unseen
    unseen_pieces = pieces[-1].if_there
    for piece in pieces:
        lies = 0.0 if piece.name == NOT_SEEN else piece.if_there / (1 - unseen_pieces)
        both = 1 - (1 - lies) * (1 - piece.if_there * unseen)
        assert piece.probability == pytest.approx(both)
    go = seen.next_place("cup", here="hall")
    assert go is not None
    assert (go.room, go.piece) == ("kitchen", pieces[0].piece)
