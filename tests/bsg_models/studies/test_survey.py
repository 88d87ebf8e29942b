from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.observation import pairs
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe
from bsg_models.evaluation.measurement import count_empty, read_truth
from bsg_models.inputs.graphs import read_split
from bsg_models.studies.measuring import choose_stride, join_surveys, survey_split


def test_a_survey_counts_what_is_read_whole(dataset: Path) -> None:
    data = Dataset.open(dataset)
    masked = read_split(data, "train")
    truth, survey = read_truth(masked), survey_split(data, "train", fold=None)
    assert survey.scene_ids == truth.scene_ids
    assert survey.masked == len(masked)
    nodes = len(truth.is_building)
    assert survey.counts["rooms"] + survey.counts["building"] == nodes
    assert {name: survey.counts[name] for name in count_empty(truth)} == count_empty(truth)
    sizes = {scene: int(data.cells(scene).sum()) for scene in data.scene_ids}
    assert survey.by_size == sorted(survey.scene_ids, key=lambda scene: sizes[scene])
    assert survey.example == survey.by_size[len(survey.by_size) // 2]
    assert choose_stride(survey, most=nodes) == 1
    assert choose_stride(survey, most=nodes - 1) == 2


def test_a_split_of_no_pairs_is_refused(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of which every building has more objects of a class than pairs can count."""
    monkeypatch.setattr(pairs, "fits_pairs", lambda cells: False)
    write_pairs(dataset, PairsRecipe(), force=True)
    with pytest.raises(DatasetError, match="no building of the split 'test' has pairs"):
        survey_split(Dataset.open(dataset), "test", fold=None)


def test_folds_are_surveyed_together(dataset: Path) -> None:
    data = Dataset.open(dataset)
    parts = [survey_split(data, split, fold=None) for split in ("train", "test")]
    both = join_surveys(parts)
    assert both.scene_ids == parts[0].scene_ids + parts[1].scene_ids
    assert both.counts["rooms"] == sum(part.counts["rooms"] for part in parts)
    assert both.masked == sum(part.masked for part in parts)
