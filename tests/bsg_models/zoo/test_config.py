from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from conftest import tomllib
from hypothesis import example, given
from hypothesis import strategies as st

from bsg_data.recipes import MaskRecipe
from bsg_models.errors import ConfigError
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import (
    RunConfig,
    find_config,
    override,
    read_config,
    validate_config,
    write_toml,
)
from bsg_models.zoo.ensemble import EnsembleConfig
from bsg_models.zoo.model import make_model
from bsg_models.zoo.settings import DataConfig, TrainingConfig

COUNTING = {
    "input",
    "doubled",
    "train-mean",
    "gamma-poisson",
    "tilted-gamma-poisson",
    "mixture",
}


def tables(name: str = "ceci") -> dict[str, Any]:
    return find_config(name).model_dump(mode="json")


@pytest.mark.parametrize(
    ("setting", "place"),
    [
        ("training.epoch=5", "training.epoch"),
        ("model.widht=5", "model.widht"),
        ("training.epochs=0", "training.epochs"),
        ("data.edges=['sideways']", "data.edges.0"),
        ("model.family=gcn", "model.family"),
        ("training", "--set training"),
        ("training.learning_rate=inf", "training.learning_rate"),
        ("seed.x=1", "--set seed.x=1"),
    ],
)
def test_a_wrong_value_is_named_with_its_path(setting: str, place: str) -> None:
    with pytest.raises(ConfigError) as caught:
        validate_config(override(tables(), [setting]), source="test")
    assert place in str(caught.value)


def test_unknown_names_and_files(tmp_path: Path) -> None:
    with pytest.raises(ConfigError):
        find_config("cecin")
    with pytest.raises(ConfigError):
        read_config(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("seed = = 1")
    with pytest.raises(ConfigError):
        read_config(tmp_path / "bad.toml")


@given(
    members=st.lists(st.text(), min_size=2, max_size=3, unique=True),
    rate=st.floats(min_value=1e-12, max_value=1e6),
)
@example(members=['b"\\c', "two\nlines\r\n", "\x1b[31m"], rate=1e-7)
def test_any_configuration_survives_toml(members: list[str], rate: float) -> None:
    config = RunConfig(
        model=EnsembleConfig.model_construct(members=tuple(members)),
        training=TrainingConfig(learning_rate=rate),
    )
    said = tomllib.loads(write_toml(config))
    assert said["model"]["members"] == members
    assert said["training"]["learning_rate"] == rate
    assert "clip" not in said["training"]  # None has no spelling in TOML


@pytest.mark.parametrize("name", ["a\0b", "two\nlines", "\x1b[31mred", "\u202elive", "x" * 1_001])
def test_a_name_that_no_table_can_show_is_refused(name: str) -> None:
    with pytest.raises(ConfigError):
        validate_config({"name": name, "model": {"family": "doubled"}}, source="test")


@pytest.mark.parametrize("name", ZOO.names())
def test_a_row_is_a_configuration_and_its_model(name: str) -> None:
    row, config = ZOO[name], find_config(name)
    assert (config.model, config.data, config.training) == (row.config, row.data, row.training)
    assert "\n" not in row.describe() != ""
    model = make_model(config, classes=3, vocabulary=("tap", "wall"))
    assert model.config == row.config
    assert (model.inputs.classes, model.inputs.edges) == (3, row.data.edges)
    assert model.vocabulary == (("tap", "wall") if config.reads_categories else ())
    assert model.by_gradient == (name not in COUNTING | {"ensemble"})


ROOMS = MaskRecipe(strategy="rooms", fraction=0.3, seed=1)


@pytest.mark.parametrize(
    ("choice", "stored", "own"),
    [
        (DataConfig(), MaskRecipe(strategy="rooms"), False),  # the paper's, wherever it is tested
        (DataConfig(mask=ROOMS), MaskRecipe(), True),
        (DataConfig(mask=ROOMS), None, True),
        (DataConfig(mask=ROOMS), MaskRecipe(strategy="rooms"), False),
        (DataConfig(mask=MaskRecipe(withhold=0.05)), MaskRecipe(), True),
        (DataConfig(masks="fixed", mask=ROOMS), MaskRecipe(), False),
    ],
)
def test_validation_draws_masks_where_stored_pairs_are_of_another_kind(
    choice: DataConfig, stored: MaskRecipe | None, own: bool
) -> None:
    assert choice.needs_own_masks(stored) is own
