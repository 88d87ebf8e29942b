"""The benchmarks' frame: what a row says, and a page of few and tiny benchmarks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from conftest import REPOSITORY, load_script

FOLDER = REPOSITORY / "scripts" / "bench"
TINY = """
from timing import Speed

def measure():
    yield Speed("a step", "an MLP", ours_s=3.0, theirs_s=1.0, target=2.5)
    yield Speed("a draw", "a loop", ours_s=1.0, theirs_s=40.0, target=30, at_least=True)
    yield Speed("an order", "", ours_s=0.05, theirs_s=None, target=0.05)
"""


@pytest.fixture
def speed(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The frame as `python scripts/bench/speed.py` finds it: beside its siblings."""
    with monkeypatch.context() as patch:
        patch.syspath_prepend(FOLDER)
        yield load_script("bench/speed")


def test_a_page_tells_what_was_met_and_what_is_missing(
    speed: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tiny.py").write_text(TINY)
    monkeypatch.setattr(speed, "FOLDER", tmp_path)
    monkeypatch.setattr(speed, "BENCHMARKS", ("tiny", "absent"))
    monkeypatch.setattr(speed, "run_alone", speed.measure)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(speed.os, "environ", {})
    page = tmp_path / "speed.md"
    assert speed.main([f"--out={page}"]) == 0
    text = page.read_text("utf-8")
    assert "2 of 3 targets are met." in text
    assert "Not measured: absent." in text
    assert re.findall(r"^\| (a step|a draw|an order) \| (.*) \|$", text, re.MULTILINE) == [
        ("a step", "an MLP | 3.00 s | 1.00 s | 3 × | ≤ 2.5 × | missed | `scripts/bench/tiny.py`"),
        ("a draw", "a loop | 1.00 s | 40.0 s | 40 × | ≥ 30 × | met | `scripts/bench/tiny.py`"),
        ("an order", "– | 50.0 ms | – | – | ≤ 50.0 ms | met | `scripts/bench/tiny.py`"),
    ]
    assert "python scripts/bench/speed.py --out=speed.md" in text
    assert re.search(r"Machine: \d+ cores of \w+, \w+, CPython 3\.", text)
    assert str(tmp_path) not in text


def test_every_benchmark_that_is_there_can_be_run_alone(speed: ModuleType) -> None:
    for name in speed.BENCHMARKS:
        path = FOLDER / f"{name}.py"
        if path.is_file():
            text = path.read_text("utf-8")
            assert f"python scripts/bench/{name}.py" in text
            assert (
                text.endswith('if __name__ == "__main__":\n    main()\n') or "print_speeds" in text
            )
