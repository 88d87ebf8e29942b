"""Counts of a dataset by hand, and looked up again in its own map."""

from __future__ import annotations

from pathlib import Path

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.statistics import (
    count_classes,
    measure_coverage,
    plot_frequencies,
)
from bsg_data.scene.class_map import load_class_map

BEDROOMS = sum(range(12))


def test_the_parts_of_the_twelve_add_up(dataset: Path) -> None:
    data = Dataset.open(dataset)
    found = measure_coverage(data)
    assert found == measure_coverage(data, load_class_map())
    assert found["structure"] == 12 * 4 + 2 * BEDROOMS  # wall and floor of every room
    assert found["nameless"] == 12 * 2  # "unknown" and "" of every bathroom
    assert found["unmapped"] == BEDROOMS  # "zzqx thing"
    assert found["classified"] == 12 * 13 + 6 * BEDROOMS
    parts = ("structure", "nameless", "unmapped", "classified", "left_out")
    assert found["objects"] == sum(found[part] for part in parts)
    assert found["share"] == found["classified"] / (found["objects"] - found["structure"])


def test_classes_of_the_twelve(dataset: Path) -> None:
    counted = count_classes(Dataset.open(dataset))
    rows = {name: tuple(numbers) for name, *numbers in map(dict.values, counted)}
    assert rows["pillow"] == (2 * BEDROOMS, BEDROOMS, 11)
    assert rows["book"] == (12, 0, 12)
    assert rows["toy"] == (0, 0, 0)


def test_a_figure_shows_a_name_that_is_a_formula_of_matplotlib(tmp_path: Path) -> None:
    rows = [{"class": r"$\nothing$", "instances": 1, "rooms": 1}]
    plot_frequencies(rows, tmp_path / "x.png", title="t")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
