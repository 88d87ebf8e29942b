"""What `check_results` says of folders; that it finds every flipped byte is in tests/faults."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from bsg_cli.models import main
from bsg_data.errors import DatasetError
from bsg_models.errors import CheckpointError
from bsg_models.studies.sealed_results import check_results


def test_a_run_and_its_checkpoint_are_sound(run: Path) -> None:
    assert check_results(run) == ("best.safetensors", "config.toml", "log.jsonl")
    assert check_results(run / "best.safetensors") == ("best.safetensors",)
    done = CliRunner().invoke(main, ["check", str(run), str(run / "best.safetensors")])
    assert done.output.splitlines() == [
        f"{run}: sound (3 files)",
        f"{run / 'best.safetensors'}: sound",
    ]


def test_what_was_changed_or_has_no_seal_is_refused(run: Path, tmp_path: Path) -> None:
    (run / "log.jsonl").write_text("{}")
    done = CliRunner().invoke(main, ["check", str(run)])
    assert done.exit_code == 1
    assert "log.jsonl: was changed" in done.output
    (run / "SHA256SUMS").unlink()
    with pytest.raises(DatasetError, match="has no SHA256SUMS"):
        check_results(run)
    with pytest.raises(DatasetError, match="no such folder or file"):
        check_results(tmp_path / "nothing")
    with pytest.raises(CheckpointError, match="not a readable checkpoint"):
        check_results(run / "log.jsonl")
