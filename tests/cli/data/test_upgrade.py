from __future__ import annotations

import json
from pathlib import Path

from data_commands import run


def test_a_dataset_of_today_is_left_alone(dataset: Path) -> None:
    before = (dataset / "dataset.json").read_bytes()
    assert "is of format version 2 already" in run("upgrade", dataset).stdout
    answer = json.loads(run("upgrade", dataset, "--json").stdout)
    assert answer == {"before": 2, "now": 2}
    assert (dataset / "dataset.json").read_bytes() == before
