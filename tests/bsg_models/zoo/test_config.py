from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from conftest import tomllib
from hypothesis import example, given
from hypothesis import strategies as st

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
from bsg_models.zoo.settings import TrainingConfig


def tables(name: str = "ceci-gcn") -> dict[str, Any]:
    return find_config(name).model_dump(mode="json")


@pytest.mark.parametrize("name", ZOO.names())
def test_every_configuration_survives_toml(name: str, tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(write_toml(find_config(name)), "utf-8")
    assert validate_config(read_config(path), source="file") == find_config(name)


def test_the_papers_values_are_the_defaults() -> None:
    """Section IV-A: 5 layers, 5000 epochs, batches of 24, Adam 0.01, decay 5e-6, MSE."""
    paper = find_config("ceci-gcn")
    assert paper.model.depth == 5  # type: ignore[union-attr]
    training = paper.training
    assert (training.epochs, training.batch_size, paper.model.likelihood) == (5000, 24, "mse")  # type: ignore[union-attr]
    assert (training.learning_rate, training.decay) == (0.01, 5e-6)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("training.epoch=5", "training.epoch is not a key; did you mean epochs?"),
        ("model.widht=5", "model.widht is not a key; did you mean width?"),
        ("data.mask.fractoin=0.1", "data.mask.fractoin is not a key; did you mean fraction?"),
        ("sed=1", "sed is not a key; did you mean seed?"),
        ("training.zzz=1", "training.zzz is not a key; valid are epochs"),
        (
            "training.epochs=0",
            "training.epochs: input should be greater than or equal to 1",
        ),
        ("training.epochs=many", "training.epochs: input should be a valid integer"),
        ("model.dropout=1.0", "model.dropout: input should be less than 1"),
        ("data.edges=['sideways']", "data.edges.0: input should be 'up', 'down'"),
        ("model.family=gcn", "model.family must be one of input, doubled"),
        ("training", "expected path=value"),
        ("input=3", "input is not a key"),
        ("training.input=1", "training.input is not a key"),
        ("training.epochs=true", "training.epochs: input should be a valid integer"),
        ("training.epochs=5.5", "training.epochs: input should be a valid integer"),
        ("training.learning_rate=inf", "input should be a finite number"),
        ("seed=99999999999999999999", "seed: input should be less than"),
        ("seed.x=1", "seed is a value and has no keys"),
    ],
)
def test_a_wrong_value_is_named_with_its_path(setting: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        validate_config(override(tables(), [setting]), source="test")
    assert message in str(caught.value)


def test_unknown_names_and_files(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"did you mean ceci-gcn\?"):
        find_config("ceci-gcnn")
    with pytest.raises(ConfigError, match="cannot be read"):
        read_config(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("seed = = 1")
    with pytest.raises(ConfigError, match="not TOML"):
        read_config(tmp_path / "bad.toml")


def test_overrides_do_not_touch_the_zoo() -> None:
    before = find_config("ceci-gcn").model_dump()
    changed = validate_config(override(tables(), ["model.width=8", "seed=3"]), source="test")
    assert changed.model.width == 8  # type: ignore[union-attr]
    assert changed.seed == 3
    assert find_config("ceci-gcn").model_dump() == before


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


def test_a_run_without_a_model_is_refused() -> None:
    with pytest.raises(ConfigError, match="model: field required"):
        validate_config({"seed": 0}, source="test")
    assert RunConfig.model_fields["model"].is_required()


@pytest.mark.parametrize("name", ["a\0b", "two\nlines", "\x1b[31mred", "\u202elive", "x" * 1_001])
def test_a_name_that_no_table_can_show_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="name"):
        validate_config({"name": name, "model": {"family": "doubled"}}, source="test")
