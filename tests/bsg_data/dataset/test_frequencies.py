from __future__ import annotations

from pathlib import Path

import pandas as pd

from bsg_data.dataset.statistics import count_frequencies, plot_frequencies

BEDROOMS = sum(range(12))


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


def test_the_name_of_a_class_is_shown_as_it_is(tmp_path: Path) -> None:
    """In the words of matplotlib this name is a formula, and one that it cannot read."""
    frame = pd.DataFrame({"class": [r"$\nothing$"], "instances": [1], "rooms": [1], "scenes": [1]})
    plot_frequencies(frame, tmp_path / "x.png", title="t")
    assert (tmp_path / "x.png").is_file()
