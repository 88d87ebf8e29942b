from __future__ import annotations

from pathlib import Path

from bsg_data.dataset.statistics import measure_coverage
from bsg_data.scene.class_map import load_class_map

BEDROOMS = sum(range(12))


def test_the_parts_of_the_twelve_add_up(dataset: Path) -> None:
    found = measure_coverage(dataset, load_class_map())
    assert found.structure == 12 * 4 + 2 * BEDROOMS  # wall and floor of every room
    assert found.nameless == 12 * 2  # "unknown" and "" of every bathroom
    assert found.unmapped == BEDROOMS  # "zzqx thing"
    assert found.classified == 12 * 13 + 6 * BEDROOMS
    assert found.objects == sum(
        (found.structure, found.nameless, found.unmapped, found.classified, found.left_out)
    )
    assert found.share == found.classified / (found.objects - found.structure)
