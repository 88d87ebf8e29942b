from __future__ import annotations

from pathlib import Path

from bsg_cli.data.totals import format_losses, format_totals
from bsg_data.dataset.manifest import read_manifest


def test_totals_and_losses_are_those_of_the_manifest(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    line = format_totals(manifest)
    assert line.startswith(f"12 scenes, {manifest.totals.rooms} rooms, ")
    assert line.endswith("in 45 classes of hm3d45-v2")
    losses = format_losses(manifest)
    assert losses.startswith(f"skipped scenes: 0, unmapped objects: {manifest.totals.unmapped}")
    assert "zzqx thing" in losses
