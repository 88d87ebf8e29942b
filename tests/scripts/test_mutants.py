"""The mutants that are tried, and those that are explained."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import REPOSITORY, load_script

mutants = load_script("faults/mutants")


def test_every_room_has_files_and_tests() -> None:
    for room in mutants.ROOMS.values():
        files = mutants.list_files(room)
        assert len(files) >= len(room.files)
        tests = mutants.list_tests(files)
        assert tests
        assert all((REPOSITORY / test).is_file() for test in tests)


def test_every_explained_mutant_is_of_code_that_is_there() -> None:
    rooms = {file for room in mutants.ROOMS.values() for file in mutants.list_files(room)}
    for one in mutants.read_explained():
        assert one["file"] in rooms
        lines = {
            line.strip() for line in (REPOSITORY / one["file"]).read_text("utf-8").splitlines()
        }
        assert {*one["before"].splitlines()} <= lines, f"{one['file']}: mend or delete {one}"
        assert one["after"] != one["before"]
        assert one["reason"].endswith(".")


def test_words_are_not_mutated_and_the_rest_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mutmut")
    monkeypatch.chdir(tmp_path)  # mutmut reads its settings from where it is
    (tmp_path / "pyproject.toml").write_text(mutants.configure(("bsg_data/wide.py",), ""))
    text = (
        "def widen(number, most=3):\n"
        '    """Return more."""\n'
        "    if number > most:\n"
        "        raise ValueError(f'{number} is above', most)\n"
        "    return number + 1\n"
    )
    found = [str(one) for one in mutants.list_mutants("bsg_data/wide.py", text)]
    assert found == [
        "bsg_data/wide.py:1: `number, most=3):` became `number, most=4):`",
        "bsg_data/wide.py:3: `if number > most:` became `if number >= most:`",
        "bsg_data/wide.py:5: `return number + 1` became `return number - 1`",
        "bsg_data/wide.py:5: `return number + 1` became `return number + 2`",
    ]


def test_a_run_that_was_stopped_goes_on(tmp_path: Path) -> None:
    chosen = [
        mutants.Mutant(f"bsg_data.wide.x_widen__mutmut_{k}", "bsg_data/wide.py", 1, "a", "b")
        for k in range(4)
    ]
    assert mutants.read_results(tmp_path, chosen) == {}
    told = tmp_path / "mutants" / "bsg_data" / "wide.py.meta"
    told.parent.mkdir(parents=True)
    codes = dict(zip((one.name for one in chosen), (1, 0, None, 33), strict=True))
    told.write_text(json.dumps({"exit_code_by_key": {**codes, "bsg_data.wide.x_other": 1}}))
    known = mutants.read_results(tmp_path, chosen)
    assert [known.get(one.name) for one in chosen] == [True, False, None, False]
