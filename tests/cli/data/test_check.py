from __future__ import annotations

import json
from pathlib import Path

from data_commands import run


def test_a_dataset_with_faults_fails_the_check(dataset: Path) -> None:
    (split,) = dataset.glob("splits/*")
    split.unlink()
    result = run("check", dataset, code=1)
    assert result.stdout.startswith(f"splits/{split.name}: ")
    assert "faults: 1;" in result.stderr


def test_a_sound_dataset_passes(dataset: Path) -> None:
    assert run("check", dataset).stdout == f"{dataset}: sound\n"
    assert json.loads(run("check", dataset, "--json").stdout) == {"sound": True, "faults": []}
