"""What models make of a class that is withheld."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import observe_building

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import sample_masked
from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.folds import scenes_of
from bsg_models.training.training import new_model
from bsg_models.zoo.config import find_config
from bsg_models.zoo.model import BeliefModel, share_of, to_array
from bsg_models.zoo.settings import DataConfig

TOLD = ("gamma-poisson", "mixture", "ceci-sage", "universal", "prior-table")
STOVE = 35


def test_search_masks_are_fresh_and_uniform() -> None:
    with pytest.raises(ValueError, match="withhold needs"):
        DataConfig(masks="fixed", withhold=0.1)
    with pytest.raises(ValueError, match="withhold needs"):
        DataConfig(mask=MaskRecipe(strategy="rooms"), withhold=0.1)


def test_withhold_is_short_for_masks_of_a_search() -> None:
    mask = MaskRecipe(fraction=0.3, seed=4)
    assert DataConfig(mask=mask).fresh_mask == mask
    short = DataConfig(mask=mask, withhold=0.1).fresh_mask
    assert short == MaskRecipe(strategy="search", fraction=0.3, seed=4, withhold=0.1)
    explored = MaskRecipe(strategy="explore", withhold=0.2)
    assert DataConfig(mask=explored).fresh_mask == explored


def test_a_choice_under_another_mask_withholds_what_it_did() -> None:
    choice, rooms = DataConfig(withhold=0.1), MaskRecipe(strategy="rooms", seed=3)
    assert choice.under(MaskRecipe(seed=3)).fresh_mask.strategy == "search"
    other = choice.under(rooms)
    assert other.fresh_mask == MaskRecipe(strategy="rooms", seed=3, withhold=0.1)
    assert DataConfig.model_validate(other.model_dump()) == other
    assert DataConfig().under(rooms).fresh_mask == rooms


@pytest.mark.parametrize(
    ("choice", "stored", "own"),
    [
        (DataConfig(), MaskRecipe(strategy="rooms"), False),  # the paper's, wherever it is tested
        (DataConfig(mask=MaskRecipe(parts=True)), MaskRecipe(), False),
        (DataConfig(mask=MaskRecipe(strategy="rooms")), MaskRecipe(), True),
        (DataConfig(mask=MaskRecipe(strategy="rooms")), None, True),
        (
            DataConfig(mask=MaskRecipe(strategy="rooms", fraction=0.3, seed=1)),
            MaskRecipe(strategy="rooms"),
            False,  # fraction and seed aside they are the same
        ),
        (
            DataConfig(mask=MaskRecipe(strategy="mixed", withhold=0.05)),
            MaskRecipe(strategy="mixed"),
            True,
        ),
        (DataConfig(mask=MaskRecipe(withhold=0.05)), MaskRecipe(), True),
        (DataConfig(withhold=0.08), MaskRecipe(), True),
        (DataConfig(masks="fixed", mask=MaskRecipe(strategy="mixed")), MaskRecipe(), False),
    ],
)
def test_validation_draws_masks_where_stored_pairs_are_of_another_kind(
    choice: DataConfig, stored: MaskRecipe | None, own: bool
) -> None:
    assert choice.needs_own_masks(stored) is own


def fitted(name: str, dataset: Path) -> BeliefModel:
    torch.manual_seed(0)
    data, config = Dataset.open(dataset), find_config(name)
    model = new_model(config, data)
    model.fit(data, config.data)
    return model.eval()


@pytest.mark.parametrize("name", ["gamma-poisson", "mixture"])
def test_withholding_is_marginalising(name: str, dataset: Path) -> None:
    """Of a withheld class, and of it alone, all is hidden, as under a mask of share 1."""
    model = fitted(name, dataset)
    rooms = np.random.default_rng(0).poisson(0.7, (5, 45))
    rooms[:, STOVE] = 0  # withheld: no stove is shown anywhere
    inputs = [rooms.sum(axis=0).tolist(), *rooms.tolist()]
    plain, told = observe_building(inputs), observe_building(inputs, withheld=[STOVE])
    absent, unknown = (model.predict(one).presence[1:, STOVE] for one in (plain, told))
    assert (unknown > absent).all()
    if name == "gamma-poisson":  # the prior alone
        a, b = float(model.shape[STOVE]), float(model.rate[STOVE])  # type: ignore[arg-type, index]
        np.testing.assert_allclose(unknown, 1 - (b / (b + 1)) ** a)


@pytest.mark.parametrize("name", TOLD)
def test_a_withheld_class_is_expected_more_than_one_that_was_not_seen(
    name: str, dataset: Path
) -> None:
    model = fitted(name, dataset)
    data = Dataset.open(dataset)
    scenes = scenes_of(data, "val")[:1]
    masked = sample_masked(data, scenes, mask=MaskRecipe(), draw=0, vocabulary=model.vocabulary)
    inputs, withheld = masked.seen.inputs.copy(), masked.seen.withheld.copy()
    inputs[:, STOVE] = 0
    withheld[:, STOVE] = True
    seen = replace(masked.seen, inputs=inputs, others=np.zeros_like(masked.seen.others))
    rooms = ~seen.is_building
    absent = model.predict(seen).hidden[rooms, STOVE]
    told = model.predict(replace(seen, withheld=withheld)).hidden[rooms, STOVE]
    assert (told > absent).all()


def test_a_network_and_a_model_that_counts_are_told_the_same_share(dataset: Path) -> None:
    seen = observe_building([[3] * 45] * 3, hidden_share=[0.25, 0.5, 1.0], withheld=[STOVE])
    graph = fitted("universal", dataset).graph_of(seen)  # type: ignore[operator]
    np.testing.assert_array_equal(to_array(share_of(graph)), seen.cell_share)
    assert seen.cell_share[:, STOVE].tolist() == [1.0, 1.0, 1.0]
    assert seen.cell_share[:, 0].tolist() == [0.25, 0.5, 1.0]
