from __future__ import annotations

from pathlib import Path

from bsg_data.dataset.coverage import measure_coverage
from bsg_data.dataset.frequencies import count_frequencies, plot_frequencies
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


def test_frequencies_of_the_twelve(dataset: Path) -> None:
    rows = {row["class"]: row for row in count_frequencies(dataset).to_dict(orient="records")}
    assert rows["pillow"] == {
        "class": "pillow",
        "instances": 2 * BEDROOMS,
        "rooms": BEDROOMS,
        "scenes": 11,
    }
    assert rows["book"] == {"class": "book", "instances": 12, "rooms": 0, "scenes": 12}
    assert rows["toy"]["instances"] == 0


def test_the_figure_is_drawn(dataset: Path, tmp_path: Path) -> None:
    path = tmp_path / "classes.png"
    plot_frequencies(count_frequencies(dataset), path, title="twelve")
    assert path.read_bytes().startswith(b"\x89PNG")
