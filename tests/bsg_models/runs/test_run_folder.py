"""A run is replaced as a whole, wherever it is killed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from killed_process import start, wait_for

from bsg_data.results import UNFINISHED, require_seal
from bsg_models.runs.run_folder import (
    BEST,
    CONFIG,
    CURVE,
    LAST,
    LOG,
    METRICS,
    finish_replacing,
    open_run,
)

LOGGED = '{"event":"begun",'
OLD, NEW = (CONFIG, CURVE, LAST, LOG, METRICS), (CONFIG, LAST, LOG, METRICS)


def write(run: Path, best: bytes, text: str, names: tuple[str, ...], *, resume: bool) -> None:
    """Write the files of a run; one that is there is not written again, as in a training."""
    finish_replacing(run)
    with open_run(run, resume=resume) as place:
        (place / BEST).write_bytes(best)
        for name in names:
            if not (place / name).exists():
                (place / name).write_text(f"{LOGGED}{text}")


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_run_that_is_killed_while_it_replaces_another_is_never_a_mix(
    run: Path, tmp_path: Path, stride: int
) -> None:
    best = (run / BEST).read_bytes()
    at, how = 1, "killed"
    while how == "killed":
        run = tmp_path / str(at)
        write(run, best, "old", OLD, resume=False)
        work = partial(write, run, best, "new", NEW)
        how = wait_for(*start(partial(work, resume=False), inside=run, kill_at=at)).how
        if require_seal(run) is not None:
            assert len({(run / name).read_text() for name in NEW}) == 1
        if (run / UNFINISHED / LOG).exists() or require_seal(run) is None:
            work(resume=True)
            assert {*(require_seal(run) or ())} == {BEST, *NEW}
            assert {(run / name).read_text() for name in NEW} == {f"{LOGGED}new"}
            assert not (run / UNFINISHED).exists()
            assert not (run / CURVE).exists()
        at += stride
    assert how == "done"


def test_a_new_run_that_is_sealed_beside_the_old_one_takes_its_place(
    run: Path, tmp_path: Path
) -> None:
    """Killed between the two seals: the new run is whole, and no command keeps the old one."""
    best, place = (run / BEST).read_bytes(), tmp_path / "place"
    write(place, best, "old", OLD, resume=False)
    write(place / UNFINISHED, best, "new", NEW, resume=False)
    finish_replacing(place)
    assert (place / LOG).read_text() == f"{LOGGED}new"
    assert {*(require_seal(place) or ())} == {BEST, *NEW}
    assert not (place / UNFINISHED).exists()


def test_an_empty_log_is_of_a_disk_that_was_full(run: Path, tmp_path: Path) -> None:
    place = tmp_path / "place"
    place.mkdir()
    (place / LOG).touch()
    write(place, (run / BEST).read_bytes(), "new", (), resume=False)
    assert require_seal(place)
