"""Models by name: what they are made of, what they read, and which can go on."""

from __future__ import annotations

import pytest

from bsg_models.errors import ConfigError
from bsg_models.zoo.catalogue import BASELINES, ZOO
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.construction import can_resume, find_member, make_model, reads_categories
from bsg_models.zoo.ensemble import Ensemble
from bsg_models.zoo.gcn import CECIGCN, GCNConfig
from bsg_models.zoo.model import BeliefModel, ModelInputs, Network

COUNTING = {
    "input",
    "doubled",
    "train-mean",
    "conditional",
    "gamma-poisson",
    "tilted-gamma-poisson",
    "prior-table",
    "mixture",
}


def mix(*members: str) -> RunConfig:
    tables = find_config("ensemble").model_dump(mode="json")
    chosen = ", ".join(f'"{name}"' for name in members)
    return validate_config(override(tables, [f"model.members=[{chosen}]"]), source="test")


@pytest.mark.parametrize("name", ZOO.names())
def test_a_row_is_a_configuration_and_its_model(name: str) -> None:
    row, config = ZOO[name], find_config(name)
    assert (config.name, config.seed) == (name, 0)
    assert (config.model, config.data, config.training) == (row.config, row.data, row.training)
    assert type(ZOO[config.model.family].config) is type(row.config)
    assert row.describe()
    assert "\n" not in row.describe()
    model = make_model(config, classes=3, vocabulary=("tap", "wall"))
    assert isinstance(model, BeliefModel)
    assert model.config == row.config
    assert model.inputs.classes == 3
    assert model.inputs.edges == row.data.edges
    assert model.vocabulary == (("tap", "wall") if reads_categories(config) else ())
    assert isinstance(model, Network) == (name not in COUNTING | {"ensemble"})
    assert can_resume(config) == (name not in COUNTING)


def test_the_baselines_are_rows_that_count() -> None:
    assert set(BASELINES) <= COUNTING


def test_a_model_of_ones_own_is_named_by_its_family() -> None:
    nameless = {"model": {"family": "ceci-gcn", "depth": 2}}
    assert validate_config(nameless, source="test").name == "ceci-gcn"
    # RunConfig(model=GCNConfig()) without a name leaves it empty, with a warning of pydantic's.
    assert find_config("universal").name == "universal"
    assert find_config("universal").model.family == "ceci-sage"


def test_a_model_is_made_without_the_zoo() -> None:
    model = CECIGCN(GCNConfig(depth=2, width=7), ModelInputs(classes=5))
    assert [(c.in_channels, c.out_channels) for c in model.convolutions] == [(5, 7), (7, 5)]
    assert model.vocabulary == ()


def test_an_ensemble_reads_categories_if_a_member_does() -> None:
    assert not reads_categories(mix("gamma-poisson", "mixture"))
    assert reads_categories(mix("gamma-poisson", "ceci-sage"))
    model = make_model(mix("gamma-poisson", "ceci-sage"), classes=3, vocabulary=("tap",))
    assert isinstance(model, Ensemble)
    assert list(model.members) == ["gamma-poisson", "ceci-sage"]
    assert model.vocabulary == ("tap",)
    assert [member.vocabulary for member in model.members.values()] == [(), ("tap",)]


def test_the_recipe_of_a_member_is_the_one_that_is_given() -> None:
    """A checkpoint holds the recipes of its members, so that the zoo's may change."""
    narrow = validate_config(
        override(find_config("ceci-sage").model_dump(mode="json"), ["model.width=6"]), source="test"
    )
    model = make_model(mix("ceci-sage"), classes=3, members={"ceci-sage": narrow})
    assert isinstance(model, Ensemble)
    assert model.members["ceci-sage"].config == narrow.model


def test_members_that_are_none() -> None:
    assert find_member("mixture") == find_config("mixture")
    with pytest.raises(ConfigError, match="ensemble is an ensemble itself"):
        find_member("ensemble")
    with pytest.raises(ConfigError, match=r"did you mean mixture\?"):
        find_member("mixtrue")
    with pytest.raises(ConfigError, match="is an ensemble itself"):
        make_model(mix("ensemble"), classes=3)
