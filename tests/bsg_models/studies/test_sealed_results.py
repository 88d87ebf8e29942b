"""What `check_results` says of folders; that it finds every flipped byte is in tests/faults."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from refusals import refuses

from bsg_cli.registry import COMMANDS
from bsg_data.errors import DatasetError
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.seal import write_seal
from bsg_models.errors import CheckpointError
from bsg_models.studies.sealed_results import check_results


def test_what_is_sound_what_was_changed_and_what_has_no_seal(run: Path, tmp_path: Path) -> None:
    assert check_results(run) == ("best.safetensors", "config.toml", "training.json")
    assert check_results(run / "best.safetensors") == ("best.safetensors",)
    done = CliRunner().invoke(COMMANDS["bsg-models"], ["verify", str(run)])
    assert done.output == f"{run}: sound (3 files)\n"
    (run / "training.json").write_text("{}")
    with refuses(DatasetError, "file-changed", golden=False):
        check_results(run)
    (run / "SHA256SUMS").unlink()
    for path in (run, tmp_path / "nothing"):
        with pytest.raises(DatasetError):
            check_results(path)
    with pytest.raises(CheckpointError):
        check_results(run / "training.json")


def test_an_evaluation_of_replaced_weights_is_told(
    run: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`bsg-train --force` leaves the evaluation of the old weights in the folder of the new run."""
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})

    def invoke(line: str) -> Result:
        name, *words = line.split()
        done = CliRunner().invoke(COMMANDS[name], words)
        assert done.exit_code == 0, done.output
        return done

    evaluate = f"bsg-evaluate {dataset} --model {run}"
    train = f"bsg-train {dataset} --out {run} --force --config"
    invoke(evaluate)
    assert "evaluation.json" in check_results(run / "evaluation")
    assert "other weights" not in invoke(f"bsg-models show {run}").stderr
    told = invoke(f"{train} doubled").stderr
    assert f"{run / 'evaluation'} measures other weights than" in told
    with pytest.raises(DatasetError):
        check_results(run / "evaluation")
    monkeypatch.chdir(run / "evaluation")
    with pytest.raises(DatasetError):
        check_results(Path())
    monkeypatch.chdir(run.parent)
    invoke(f"{evaluate} --force")
    assert check_results(run / "evaluation")
    assert "other weights" not in invoke(f"bsg-models show {run}").stderr


@pytest.mark.parametrize("name", ["evaluation", "search"])
def test_results_are_of_other_weights_only_if_they_say_so(name: str, run: Path) -> None:
    """Those in another folder are of any run."""
    own = hash_file(run / "best.safetensors")
    results = run / name

    def check(said: object) -> None:
        (results / f"{name}.json").write_text(json.dumps(said))
        write_seal(results, [f"{name}.json"])
        assert check_results(results) == (f"{name}.json",)

    results.mkdir()
    for said in ({}, [], {"checkpoints_sha256": 1}, {"checkpoints_sha256": ["0" * 64, own]}):
        check(said)
    with pytest.raises(DatasetError):
        check({"checkpoints_sha256": ["0" * 64]})
    results = results.rename(run / "earlier")
    assert check_results(results)
