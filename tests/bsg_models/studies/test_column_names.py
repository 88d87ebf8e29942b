from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.files import stem_of
from bsg_data.scene.class_space import load_class_space
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.found_model import FoundModel
from bsg_models.runs.shipped import Kind
from bsg_models.studies.comparison import name_runs
from bsg_models.zoo.catalogue import BASELINES
from bsg_models.zoo.config import find_config

SPACE = load_class_space()


def run_of(model: str, folder: str, kind: Kind = "run") -> tuple[FoundModel, CheckpointHeader]:
    header = CheckpointHeader(config=find_config(model), class_space=SPACE, dataset_sha256="")
    return FoundModel(Path(folder) / "best.safetensors", folder, kind), header


@pytest.mark.parametrize(
    ("runs", "names"),
    [
        ([("mixture", "a"), ("ceci-gcn", "b")], ("mixture", "ceci-gcn")),
        ([("mixture", "a"), ("mixture", "b")], ("mixture (a)", "mixture (b)")),
        ([("mixture", "a"), ("mixture", "a")], ("mixture (a)", "mixture (a)-2")),
        ([("mixture", "a b"), ("mixture", "a-b")], ("mixture (a b)", "mixture (a-b)-2")),
        ([("gamma-poisson", "a")], ("gamma-poisson (a)",)),  # a baseline has this name
        ([("universal", "best", "shipped"), ("universal", "x")], ("best", "universal")),
        ([("mixture", "mixture")], ("mixture",)),
    ],
)
def test_a_run_is_named_by_its_model(runs: list[tuple[str, str]], names: tuple[str, ...]) -> None:
    assert name_runs([run_of(*one) for one in runs]) == names


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["mixture", "gamma-poisson", "input"]),
            st.sampled_from(["a", "a-2", "a 2", "../a", "gamma-poisson", "\n"]),
        ),
        max_size=6,
    )
)
def test_no_two_columns_and_no_two_files_have_one_name(runs: list[tuple[str, str]]) -> None:
    names = name_runs([run_of(*one) for one in runs])
    assert not set(names) & set(BASELINES)
    assert len({stem_of(name) for name in names}) == len(runs)
