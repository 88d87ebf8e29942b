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


def columns(line: str) -> list[str]:
    return re.split(r"\s{2,}", line.strip())


def test_rooms_are_ranked_with_a_plan() -> None:
    done = call(OFFICE, "--model", "mixture", "--find", "microwave", "--from", "waiting-room")
    table, plan = (part.splitlines() for part in done.stdout.split("\n\n"))
    heads = ["room", "P(microwave)", "if there is one", "expected more", "seen", "cost"]
    assert columns(table[0]) == heads
    assert table[1].startswith("kitchen (B: shared kitchen)")
    assert table[1].endswith("1 room")
    assert table[-2].endswith("by the model mixture")
    assert columns(plan[0]) == ["look into", "P", "way", "look", "ended by then"]
    seen = open_graph(OFFICE, model="mixture")
    assert len(plan) - 1 == len(seen.explain("microwave", here="waiting-room"))


FLAT = {"kitchen": ["sink", "stove"], "hall": [], "more_rooms": 3}
WHOLE = {**FLAT, "more_rooms": 0}


@pytest.mark.parametrize(
    ("home", "words", "line"),
    [
        (FLAT, "--find toilet --from kitchen", "rooms not found yet .*"),
        (
            FLAT,
            "--find toilet --from kitchen",
            "explore first: find the rooms that are not found yet",
        ),
        (WHOLE, "--find mug --from hall --cost hall kitchen closed", "kitchen .* closed"),
        (WHOLE, "--find mug --robot a=kitchen --robot b=hall", "a: go first to kitchen"),
        (WHOLE, "--find mug --robot a=kitchen --robot b=hall", "b: go first to hall"),
        (
            WHOLE,
            "--find mug --from kitchen --budget 0.1",
            "no room is left to search within 0.1 rooms",
        ),
        (FLAT, "--find shoes", ".*by the table things-v1"),
    ],
)
def test_a_line_says_where_to_go(home: object, words: str, line: str) -> None:
    shown = call("-", *words.split(), stdin=json.dumps(home))
    assert re.search(f"^{line}$", shown.stdout, re.MULTILINE), shown.stdout


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("--find bed --robot a", "--robot a: expected NAME=ROOM, such as spot=hall"),
        ("--find bed --robot a=kitchen --from kitchen", "does not use --from"),
        ("--find bed --robot a=kitchen --robot a=hall", "says kitchen and hall of a"),
        ("--find bed --look -1", "--look -1: expected [ROOM=]COST"),
        ("--find bed --look 5 --look kitchen=2", "leave one out"),
        ("--find bed --chance 1.5", "1.5"),
        ("--find bed --budget 5", "without --from or --robot does not use --budget"),
        ("--find qqqxz", "qqqxz"),
        (f"{OFFICE} --find bed", "--find: expected one GRAPH"),
        ("--find sink --top 9", "--top"),
        ("--from kitchen", "without --find does not use --from"),
        ("--force", "without --out does not use --force"),
    ],
)
def test_options_of_a_search_are_checked(words: str, fault: str) -> None:
    done = CliRunner().invoke(main, [str(OFFICE), *words.split()])
    assert done.exit_code != 0
    assert fault in " ".join(done.output.split())


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


def test_several_things_get_a_table_each_and_one_plan_with_times() -> None:
    words = (OFFICE, "--quiet", "--find", "microwave", "--find", "sofa", "--find", "microwave")
    done = call(*words, "--from", "waiting-room", "--budget", "500", "--speed", "0.5")
    *_, plan = done.stdout.split("\n\n")
    assert done.stdout.count("P(microwave)") == done.stdout.count("P(couch)") == 1
    (found,) = re.findall(r"^all found within 500 s: (.*)$", done.stdout, re.MULTILINE)
    head, *rows = map(columns, plan.splitlines())
    times = ["time", "all found by then", "any found by then"]
    assert head == ["look into", "P(any)", "way", "look", *times]
    seconds = [int(row[4].removesuffix(" s")) for row in rows]
    assert seconds == sorted(seconds)
    assert seconds[-1] <= 500
    assert rows[-1][5] == found


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
