"""`bsg-belief --find` end to end: text and JSON, from a file and from standard input."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner, Result
from conftest import REPOSITORY

from bsg_cli.belief import main
from bsg_models.robot.seen_building import open_graph

OFFICE = REPOSITORY / "docs" / "office.json"


def call(*words: object, stdin: str | None = None, code: int = 0) -> Result:
    done = CliRunner().invoke(main, [str(word) for word in words], input=stdin)
    assert done.exit_code == code, done.output
    return done


def test_rooms_are_ranked_and_the_first_is_named() -> None:
    done = call(OFFICE, "--model", "mixture", "--find", "microwave", "--from", "waiting-room")
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["room", "P(microwave)", "expected", "more", "seen", "cost"]
    assert lines[1].startswith("kitchen (B: shared kitchen)")
    assert lines[1].endswith("1 room")
    assert lines[-2].endswith("by the model mixture")
    assert lines[-1] == "go first to kitchen (B: shared kitchen)"


def test_json_tells_ids_and_the_numbers_of_python() -> None:
    words = ("--model", "mixture", "--find", "sofa", "--json", "--from", "C: meeting room")
    done = call("-", *words, stdin=OFFICE.read_text("utf-8"))
    answer, seen = json.loads(done.stdout), open_graph(OFFICE, model="mixture")
    assert answer["class"] == "couch"
    assert answer["how"] == "'sofa' is one of the class 'couch'"
    assert answer["go_first"] == seen.next_room("sofa", here="meeting-room") == "waiting-room"
    assert answer["anywhere"] == seen.anywhere("sofa")
    assert answer["cost_unit"] == "rooms"
    places = [(one["room"], one["probability"], one["cost"]) for one in answer["places"]]
    found = seen.where("sofa", here="meeting-room")
    assert places == [(one.room, one.probability, one.cost) for one in found]


def test_several_things_get_a_table_each_and_one_room_to_go_to_first() -> None:
    words = (OFFICE, "--model", "mixture", "--find", "microwave", "--find", "sofa")
    done = call(*words, "--find", "microwave", "--from", "waiting-room")
    seen = open_graph(OFFICE, model="mixture")
    first = seen.next_room(["microwave", "sofa"], here="waiting-room")
    assert done.stdout.count("P(microwave)") == done.stdout.count("P(couch)") == 1
    assert done.stdout.count("go first to") == 1
    assert done.stdout.splitlines()[-1].startswith(f"go first to {first} (")
    answer = json.loads(call(*words, "--from", "waiting-room", "--json").stdout)
    assert [one["class"] for one in answer["things"]] == ["microwave", "couch"]
    assert [one["anywhere"] for one in answer["things"]] == [
        seen.anywhere("microwave"),
        seen.anywhere("sofa"),
    ]
    assert (answer["go_first"], answer["cost_unit"]) == (first, "rooms")


def test_a_word_for_the_wide_model_says_which_model_answers() -> None:
    done = call(OFFICE, "--model", "mixture", "--find", "shoes")
    assert "by the model universal-wide" in done.stdout
    assert "cost" not in done.stdout
    assert "'shoes' is one of the class 'shoe'" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        (OFFICE, "--find", "qqqxz"),
        (OFFICE, "--from", "kitchen"),
        (OFFICE, OFFICE, "--find", "sink"),
        (OFFICE, "--find", "sink", "--top", "9"),
    ],
)
def test_what_cannot_be_asked_is_wrong_usage(words: tuple[object, ...]) -> None:
    call(*words, "--model", "mixture", code=2)
