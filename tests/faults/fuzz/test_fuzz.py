from __future__ import annotations

import random
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fuzz.catalogue import ROWS, find_target
from fuzz.mutation import change
from fuzz.target import CORPUS, Bench, Target

pytestmark = pytest.mark.heavy


@pytest.fixture(scope="module", params=ROWS)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    with Bench(find_target(request.param)) as bench:
        yield bench


def require_no_finding(bench: Bench, data: bytes) -> None:
    finding = bench.try_input(data)
    assert finding is None, f"{finding.key}\n{data!r}\n{finding.text}"


def test_what_ever_failed_does_so_no_more(bench: Bench) -> None:
    kept = bench.target.kept()
    found = {name: bench.try_input(data) for name, data in kept.items()}
    assert [f"{name}: {finding.key}" for name, finding in found.items() if finding] == []


def test_seeds_are_read(bench: Bench, capfd: pytest.CaptureFixture[str]) -> None:
    """A seed that is refused would lead a fuzzer nowhere."""
    for data in bench.target.seeds().values():
        assert len(data) <= bench.target.most
        bench.target.read(bench.folder, data)
        require_no_finding(bench, data)
    assert capfd.readouterr() == ("", "")  # of libraries in C, too


def test_changed_seeds_are_read_or_refused(bench: Bench, full: bool) -> None:
    target = bench.target
    inputs = [*target.seeds().values(), *target.kept().values()]

    @settings(
        max_examples=2_000 if full else 40,
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.sampled_from(inputs), seed=st.integers(0, 2**32))
    def run(data: bytes, seed: int) -> None:
        require_no_finding(bench, change(data, random.Random(seed), most=target.longest))

    run()


def test_every_folder_of_the_corpus_is_of_a_target() -> None:
    assert {path.name for path in CORPUS.glob("*")} <= set(ROWS)


def test_the_bench_sees_what_a_reader_must_not_do() -> None:
    faults = {
        "IndexError in test_fuzz.py, <lambda>": lambda folder, data: data[0],
        "x prints": lambda folder, data: sys.stdout.write("x"),
        "x writes": lambda folder, data: Path("x").write_text("x"),
        None: lambda folder, data: None,
    }
    for key, read in faults.items():
        with Bench(Target(name="x", read=read, seeds=dict)) as bench:
            finding = bench.try_input(b"")
        assert (None if finding is None else finding.key) == key
