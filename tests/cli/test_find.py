"""`bsg-belief --find` end to end: text and JSON, from a file and from standard input."""

from __future__ import annotations

import json
import re

import pytest
from click.testing import CliRunner
from commands import runner
from conftest import REPOSITORY

from bsg_cli.belief import main
from bsg_robot import open_graph

OFFICE = REPOSITORY / "docs" / "office.json"


call = runner(main)


def test_rooms_are_ranked_and_the_first_is_named() -> None:
    done = call(OFFICE, "--model", "mixture", "--find", "microwave", "--from", "waiting-room")
    table, plan = (part.splitlines() for part in done.stdout.split("\n\n"))
    heads = ["room", "P(microwave)", "if there is one", "expected more", "seen", "cost"]
    assert re.split(r"\s{2,}", table[0].strip()) == heads
    assert table[1].startswith("kitchen (B: shared kitchen)")
    assert table[1].endswith("1 room")
    assert table[-2].endswith("by the model mixture")
    assert table[-1] == "go first to kitchen (B: shared kitchen)"
    assert re.split(r"\s{2,}", plan[0].strip()) == [
        "look into",
        "P",
        "way",
        "look",
        "ended by then",
    ]
    assert plan[1].startswith("kitchen (B: shared kitchen)")
    seen = open_graph(OFFICE, model="mixture")
    assert len(plan) - 1 == len(seen.explain("microwave", here="waiting-room"))


def test_several_robots_are_sent_to_rooms_of_their_own() -> None:
    words = ("--find", "microwave", "--robot", "a=kitchen", "--robot", "b=waiting-room")
    lines = call(OFFICE, "--quiet", *words).stdout.splitlines()[-2:]
    assert lines[0] == "a: go first to kitchen (B: shared kitchen)"
    assert lines[1].startswith("b: go first to ")
    assert "kitchen" not in lines[1]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--find", "bed", "--robot", "a"), "--robot a: expected NAME=ROOM, such as spot=hall"),
        (("--find", "bed", "--robot", "a=attic"), "no room 'attic'"),
        (("--find", "bed", "--robot", "a=kitchen", "--from", "kitchen"), "does not use --from"),
        (
            ("--find", "bed", "--robot", "a=kitchen", "--robot", "a=hall"),
            "says kitchen and hall of a",
        ),
        (("--find", "bed", "--look", "-1"), "--look -1: expected [ROOM=]COST"),
        (("--find", "bed", "--look", "5", "--look", "kitchen=2"), "leave one out"),
        (("--find", "bed", "--chance", "1.5"), "1.5"),
        (("--find", "bed", "--budget", "5"), "without --from or --robot does not use --budget"),
        (("--find", "bed", "--cost", "kitchen", "kitchen", "inf"), "or 'closed', found inf"),
        (("--find", "bed", "--cost", "kitchen", "1"), "--cost"),
        (("--find", "qqqxz"), "qqqxz"),
        (("--now", "soon"), "'--now': expected a time"),
        ((str(OFFICE), "--find", "bed"), "--find: expected one GRAPH"),
        (("--find", "sink", "--top", "9"), "--top"),
        (("--from", "kitchen"), "without --find does not use --from"),
        (("--force",), "without --out does not use --force"),
    ],
)
def test_options_of_a_search_are_checked(words: tuple[str, ...], said: str) -> None:
    done = CliRunner().invoke(main, [str(OFFICE), *words])
    assert done.exit_code != 0
    assert said in " ".join(done.output.split())


def test_a_thing_without_a_class_is_noted_not_counted() -> None:
    done = call(OFFICE, "--find", "cabbage leaf")
    lines, seen = done.stdout.splitlines(), open_graph(OFFICE)
    heads = ["room", "if there is one", "noted", "expected more", "seen"]
    assert re.split(r"\s{2,}", lines[0].strip()) == heads
    best = seen.where("cabbage leaf")[0]
    percents = [f"{round(100 * share)} %" for share in (best.if_there, best.probability)]
    assert re.split(r"\s{2,}", lines[1].strip())[:3] == ["kitchen (B: shared kitchen)", *percents]
    assert lines[-2].startswith(
        f"noted: annotators write one down in {seen.anywhere('cabbage leaf'):.0%}".replace(
            "%", " %"
        )
    )
    assert "no model counts 'cabbage leaf'" in done.stderr


def test_rooms_that_are_not_found_yet_are_a_place_and_may_come_first() -> None:
    home = json.dumps({"kitchen": ["sink", "stove"], "hall": [], "more_rooms": 3})
    done = call("-", "--find", "toilet", "--from", "kitchen", stdin=home)
    assert done.stdout.splitlines()[1].startswith("rooms not found yet")
    (go,) = (line for line in done.stdout.splitlines() if "explore" in line)
    assert go == "explore first: find the rooms that are not found yet"


def test_several_things_get_a_table_each_and_one_room_to_go_to_first() -> None:
    words = (OFFICE, "--model", "mixture", "--find", "microwave", "--find", "sofa")
    done = call(*words, "--find", "microwave", "--from", "waiting-room")
    seen = open_graph(OFFICE, model="mixture")
    first = seen.next_room(["microwave", "sofa"], here="waiting-room")
    assert done.stdout.count("P(microwave)") == done.stdout.count("P(couch)") == 1
    (go,) = (line for line in done.stdout.splitlines() if line.startswith("go first to"))
    assert go.startswith(f"go first to {first} (")
    answer = json.loads(call(*words, "--from", "waiting-room", "--json").stdout)
    assert [single["class"] for single in answer["things"]] == ["microwave", "couch"]
    single = json.loads(call(*words[:-2], "--from", "waiting-room", "--json").stdout)
    assert single.keys() == answer.keys(), "one shape for one and several"


def test_a_plan_of_several_things_says_when_any_and_all_are_found_and_after_how_long() -> None:
    words = (OFFICE, "--quiet", "--find", "microwave", "--find", "sofa", "--from", "waiting-room")
    text = call(*words, "--budget", "500", "--speed", "0.5").stdout
    (line,) = re.findall(r"^all found within 500 s: (.*)$", text, re.MULTILINE)
    head, *rows = (re.split(r"\s{2,}", row.strip()) for row in text.split("\n\n")[-1].splitlines())
    times = ["time", "all found by then", "any found by then"]
    assert head == ["look into", "P(any)", "way", "look", *times]
    seconds = [int(row[4].removesuffix(" s")) for row in rows]
    assert seconds == sorted(seconds)
    assert seconds[-1] <= 500
    assert rows[-1][5] == line


def test_a_budget_for_no_room_says_so_and_a_closed_door_is_shown() -> None:
    words = ("--find", "microwave", "--from", "waiting-room")
    lines = call(OFFICE, "--quiet", *words, "--budget", "0.5").stdout.splitlines()
    assert lines[-1] == "no room is left to search within 0.5 rooms"
    flat = json.dumps({"kitchen": ["sink"], "hall": [], "more_rooms": 0})
    closed = ("--find", "mug", "--from", "hall", "--cost", "hall", "kitchen", "closed")
    (kitchen,) = re.findall("^kitchen .*", call("-", *closed, stdin=flat).stdout, re.MULTILINE)
    assert kitchen.endswith("closed")


def test_a_home_says_what_it_has_taught_and_as_of_which_time() -> None:
    home = {
        "rooms": {"hall": ["shelf"], "study": ["desk"]},
        "more_rooms": 0,
        "memory": [{"id": "k", "category": "key", "sightings": [[3600, "hall", "shelf 1"]]}],
        "customs": [{"thing": "key", "room": "study"}],
    }
    words = ("-", "--find", "keys", "--from", "hall")
    done = call(*words, stdin=json.dumps(home))
    (taught,) = re.findall("^this home has taught, (.*)$", done.stdout, re.MULTILINE)
    first, second, last = taught.removeprefix("by 1 sighting: ").split("; ")
    assert re.fullmatch(r"study [0-9]+ % \(told\)", first)
    assert re.fullmatch(r"hall, shelf [0-9]+ % \(1 seen, the last <1 h ago\)", second)
    assert last.startswith("elsewhere")
    assert "answers are as of 3600.0; say `now`" in done.stderr
    done = call(*words, "--now", "90000", stdin=json.dumps(home))
    assert "(1 seen, the last 24 h ago)" in done.stdout
    assert "as of" not in done.stderr
    page = call("-", "--now", "1970-01-01T00:00:00Z", stdin=json.dumps(home), code=2)
    assert "now: expected a time after 3600.0" in page.stderr


def test_an_everyday_thing_says_that_the_table_answers() -> None:
    done = call(OFFICE, "--model", "mixture", "--find", "shoes")
    assert "by the table things-v1" in done.stdout
    assert "cost" not in done.stdout
    assert "'shoes' is 'shoe'; people search for it in: entrance" in done.stderr
