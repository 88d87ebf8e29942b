from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from prediction_rows import rows

from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import open_predictions


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (
            {"presence": [0.5, 1.5]},
            r"row 1: expected a probability, 0 to 1, in presence, found 1\.5",
        ),
        ({"presence": [np.nan, 0.5]}, r"row 0: expected a (value|probability)"),
        ({"presence": [0.5, None]}, r"row 1: expected a (value|probability.*) in presence"),
        ({"expected": [0.5, -1]}, r"row 1: expected a number from 0 to 1e9 in expected"),
        ({"expected": [0.5, np.inf]}, r"row 1: expected a number"),
        ({"total": [np.inf, 0.5]}, r"row 0: expected a finite number"),
        ({"p0": [0.5, 0.5]}, r"row 1: expected 1 − presence in p0, found 0\.5"),
        ({"p0": [0.5, 0.75], "p1": [0.2, 0.3]}, r"row 1: expected a sum of 1 at most"),
        ({"p1": [0.5, 0.75]}, r"expected p0, p1, … without a gap"),
        ({"p0": [0.5, 0.75], "p2": [0.0, 0.0]}, r"expected p0, p1, … without a gap"),
        ({"draw": ["0", "0"]}, r"expected integers in draw, found (large_)?string"),
        ({"class": [1, 2]}, r"expected text in class, found int64"),
        ({"expected": ["1", "2"]}, r"expected numbers in expected"),
    ],
)
def test_what_cannot_be_scored_is_refused(
    tmp_path: Path, change: dict[str, list[Any]], found: str
) -> None:
    path = tmp_path / "a.parquet"
    rows(**change).to_parquet(path)
    with pytest.raises(PredictionError, match=found):
        list(open_predictions(path, most_rows=2).read())


def test_columns_and_rows_are_counted_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    rows().drop(columns="presence").to_parquet(path)
    with pytest.raises(PredictionError, match="presence is missing or double; found scene_id"):
        open_predictions(path, most_rows=2)
    rows().to_parquet(path)
    with pytest.raises(PredictionError, match=r"expected at most 1 rows.*found 2"):
        open_predictions(path, most_rows=1)
    with pytest.raises(PredictionError, match="No such file"):
        open_predictions(tmp_path / "none", most_rows=1)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(PredictionError, match="not readable as parquet"):
        open_predictions(path, most_rows=2)
    (tmp_path / "folder").mkdir()
    with pytest.raises(PredictionError, match=r"holds no file \*\.parquet"):
        open_predictions(tmp_path / "folder", most_rows=2)


def test_files_of_a_folder_are_one_and_keep_their_row_numbers(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    rows(extra=["x", "y"]).to_parquet(folder / "fold-0.parquet")
    second = rows(scene_id=["b", "a"]).astype({"class": "category", "draw": np.uint8})
    pq.write_table(pa.Table.from_pandas(second), folder / "fold-1.parquet")
    found = open_predictions(folder, most_rows=4)
    assert [rows for _, rows in found.files] == [2, 2]
    pieces = list(found.read())
    assert [p.scenes[i] for p in pieces for i in p.scene] == ["a", "a", "b", "a"]
    assert [p.classes[i] for p in pieces for i in p.label] == ["chair", "bed", "chair", "bed"]
    assert [p.place for p in pieces] == [(file, 0) for file, _ in found.files]
    assert pieces[1].values["presence"].tolist() == [0.5, 0.25]
    rows(p0=[0.5, 0.75]).to_parquet(folder / "fold-2.parquet")
    with pytest.raises(PredictionError, match="different columns"):
        open_predictions(folder, most_rows=6)


def test_an_empty_table_is_read_as_no_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    empty: pd.DataFrame = rows()[:0]
    pq.write_table(pa.Table.from_pandas(empty, schema=pa.Schema.from_pandas(rows())), path)
    assert len(open_predictions(path, most_rows=2)) == 0
