"""Predictions of any program: what is read, and one fault of each kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from prediction_rows import rows
from refusals import refuses

from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import read_predictions


@pytest.mark.parametrize(
    ("change", "row"),
    [
        ({"presence": [0.5, 1.5]}, 1),
        ({"presence": [0.5, None]}, 1),
        ({"expected": [0.5, -1]}, 1),
        ({"expected": [0.5, np.inf]}, 1),
        ({"total": [np.inf, 0.5]}, 0),
        ({"p0": [0.5, 0.5]}, 1),  # is not 1 - presence
        ({"p0": [0.5, 0.75], "p1": [0.2, 0.3]}, 1),
    ],
)
def test_a_value_out_of_range_is_refused_with_its_row(
    tmp_path: Path, change: dict[str, list[Any]], row: int
) -> None:
    path = tmp_path / "a.parquet"
    rows(**change).to_parquet(path)
    with refuses(PredictionError, "prediction-row", where=f"{path}: row {row}"):
        read_predictions(path)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"p0": [0.5, 0.75], "p1": [None, 0.0]}, "prediction-row"),
        ({"draw": ["a", "b"]}, "parquet-unreadable"),
        ({"expected": ["a", "b"]}, "parquet-unreadable"),
        ({"presence": None}, "predictions-column"),
    ],
)
def test_other_columns_than_those_expected_are_refused(
    tmp_path: Path, change: dict[str, Any], code: str
) -> None:
    path = tmp_path / "a.parquet"
    absent = [name for name, values in change.items() if values is None]
    rows(**{k: v for k, v in change.items() if v}).drop(columns=absent).to_parquet(path)
    with refuses(PredictionError, code):
        read_predictions(path)


def test_a_folder_without_predictions_is_refused(tmp_path: Path) -> None:
    with refuses(PredictionError, "predictions-none", where=tmp_path):
        read_predictions(tmp_path)


def test_files_of_a_folder_are_one_and_keep_their_row_numbers(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    first, second = folder / "fold-0.parquet", folder / "fold-1.parquet"
    rows(extra=["x", "y"]).to_parquet(first)
    table = rows(scene_id=["b", "a"]).astype({"class": "category", "draw": np.uint8})
    pq.write_table(pa.Table.from_pandas(table), second)
    found = read_predictions(folder)
    assert list(found.rows.index) == [(first, 0), (first, 1), (second, 0), (second, 1)]
    assert list(found.rows["scene_id"]) == ["a", "a", "b", "a"]
    assert list(found.rows["class"]) == ["chair", "bed", "chair", "bed"]
    assert list(found.rows["presence"]) == [0.5, 0.25, 0.5, 0.25]
    assert found.exactly == []
    rows(p0=[0.5, 0.75]).to_parquet(folder / "fold-2.parquet")
    with refuses(PredictionError, "prediction-row", where=f"{first}: row 0"):
        read_predictions(folder)


def test_what_pandas_made_an_index_is_a_column(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    indexed: pd.DataFrame = rows().set_index(["scene_id", "draw", "node_index"])
    indexed.to_parquet(path)
    assert len(read_predictions(path).rows) == len(rows())
