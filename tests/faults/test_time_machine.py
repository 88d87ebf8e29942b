"""What earlier versions wrote is read by this one, and means what it meant (fixtures/README.md)."""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path

import pytest
from tally import Tally

from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.merge import upgrade_dataset
from bsg_models.belief import header
from bsg_models.belief.formats import read_belief
from bsg_models.belief.tables import read_tables
from bsg_models.runs.checkpoint import CHECKPOINT_VERSION, load_checkpoint, read_header
from bsg_models.studies.belief_report import BeliefRequest, report_beliefs
from bsg_models.studies.run_summary import summarise_run

FIXTURES = Path(__file__).parent / "fixtures"
ERAS = sorted(path.stem for path in FIXTURES.glob("era-*.zip"))


@pytest.fixture(params=ERAS)
def era(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    with zipfile.ZipFile(FIXTURES / f"{request.param}.zip") as archive:
        archive.extractall(tmp_path / request.param)
    return tmp_path / request.param


def test_what_was_published_never_changes() -> None:
    lines = (FIXTURES / "SHA256SUMS").read_text("utf-8").splitlines()
    sums = dict(line.split("  ")[::-1] for line in lines)
    found = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in FIXTURES.glob("*.zip")}
    assert found == sums


def test_every_version_has_a_fixture(tmp_path: Path) -> None:
    found: dict[str, set[object]] = {"dataset": set(), "checkpoint": set(), "belief": set()}
    for name in ERAS:
        with zipfile.ZipFile(FIXTURES / f"{name}.zip") as archive:
            found["dataset"].add(json.loads(archive.read("dataset/dataset.json"))["format_version"])
            found["belief"].add(json.loads(archive.read("belief.json"))["version"])
            path = Path(archive.extract("counted/best.safetensors", tmp_path / name))
            found["checkpoint"].add(read_header(path).checkpoint_version)
    assert found["dataset"] == set(range(1, FORMAT_VERSION + 1))
    assert found["checkpoint"] == set(range(1, CHECKPOINT_VERSION + 1))
    assert found["belief"] == set(range(1, header.VERSION + 1))


def test_a_dataset_is_sound_and_upgraded(era: Path, tally: Tally) -> None:
    dataset = era / "dataset"
    said = json.loads((era / "info.json").read_text("utf-8"))["totals"]
    faults = check_dataset(dataset)
    totals = read_manifest(dataset).totals.model_dump()
    if read_manifest(dataset).format_version < FORMAT_VERSION:
        upgrade_dataset(dataset)
        faults += check_dataset(dataset)
    again = read_manifest(dataset).totals.model_dump()
    sound = not faults and {**totals, **said} == totals == again
    tally(test="written long ago", command=f"dataset of {era.name}", tried=1, survived=int(sound))
    assert not faults
    assert {**totals, **said} == totals == again


def test_a_belief_graph_is_the_same_in_every_format(era: Path) -> None:
    belief = read_belief(era / "belief.json")
    assert list(read_tables(era / "tables")) == [belief]
    assert read_belief(era / "belief.dsg.json") == belief


@pytest.mark.parametrize(
    ("run", "told"), [("counted", "believed"), ("trained", "believed_by_trained")]
)
def test_a_run_believes_what_it_believed(era: Path, run: str, told: str, tally: Tally) -> None:
    load_checkpoint(era / run / "best.safetensors")
    summarise_run(era / run)
    report = report_beliefs(BeliefRequest(run=era / run, graphs=(era / "robot.json",)))
    rooms = json.loads((era / f"{told}.json").read_text("utf-8"))
    found = [(room.room, room.seen, room.expected_more) for room in report.rooms]
    expected = [(r["room"], r["seen"], pytest.approx(r["expected_more"], abs=2e-3)) for r in rooms]
    same = found == expected
    tally(test="written long ago", command=f"{run} of {era.name}", tried=1, survived=int(same))
    assert found == expected
