"""No name in a file leads out of the folders that a command was given.

Names of an attacker stand in every place of `hostile_places`. A folder beside is watched: nothing
in it is opened, made, moved or removed. A command that refuses a name says so, without a traceback.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest
from click.testing import CliRunner
from conftest import working_in
from hostile_places import PLACES, Place, hostile_names, write_victim
from watched_folder import snapshot, watch

from bsg_cli.registry import COMMANDS


def try_line(words: Sequence[str], folder: Path) -> str:
    """Run a command in a folder; return what is wrong with how it ended, empty if nothing is."""
    with working_in(folder):
        done = CliRunner().invoke(COMMANDS[words[0]], list(words[1:]))
    line = " ".join(words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return f"{line}: {done.exception!r}"
    return f"{line}: exit {done.exit_code} without a word" * (
        done.exit_code != 0 and not done.output
    )


@pytest.mark.heavy
@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.title.replace(" ", "-"))
def test_a_name_leads_nowhere(
    place: Place, request: pytest.FixtureRequest, tmp_path: Path, full: bool
) -> None:
    if place.is_slow and not full:
        pytest.skip("takes long: --full tries it")
    victim = write_victim(tmp_path / "victim")
    names = hostile_names(victim)
    first = PLACES.index(place) % len(names)
    tried = names if full else names[first : first + 1]  # of all places together, every name
    misses: list[str] = []
    for number, name in enumerate(tried):
        folder = tmp_path / "work" / str(number)
        folder.mkdir(parents=True)
        for what in place.needs:
            shutil.copytree(request.getfixturevalue(f"_{what}"), folder / what)
        lines = place.put(folder, name)
        before = snapshot(tmp_path / "work")
        with watch(victim) as seen:
            faults = [fault for words in lines if (fault := try_line(words, folder))]
        after = snapshot(tmp_path / "work")
        outside = {
            path for path in after.keys() - before.keys() if not path.startswith(f"{number}/")
        }
        misses += [f"{name[:60]!r}: {what}" for what in (*faults, *seen.events, *sorted(outside))]
        shutil.rmtree(folder)
    assert not misses, "\n".join(misses)


def test_the_watch_sees_who_opens_makes_and_removes(tmp_path: Path) -> None:
    victim = write_victim(tmp_path / "victim")
    with watch(victim) as seen:
        (victim / "evil.csv").read_bytes()
        (victim / "new").touch()
        (victim / "evil.json").unlink()
    assert any(event.startswith("evil.csv was opened") for event in seen.events) or not seen.events
    assert "new is not what it was" in seen.events
    assert "evil.json is not what it was" in seen.events
    with watch(victim) as seen:
        (victim / "evil.png").exists()
    assert seen.events == []
