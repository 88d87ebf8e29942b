"""What a search sees, by hand; and what models make of a class that is withheld."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import graph

from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.graphs import MaskedGraphs
from bsg_models.inputs.search_masks import sample_search, view_search
from bsg_models.training.training import new_model
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import DataConfig
from bsg_models.zoo.families import BoostingConfig
from bsg_models.zoo.masked_rooms import sample_chosen, sample_uniform
from bsg_models.zoo.model import BeliefModel

TOLD = ("gamma-poisson", "naive-bayes", "mixture", "ceci-sage", "search-sage")


def test_a_view_by_hand() -> None:
    cells = np.array([[1, 1], [4, 2], [0, 6], [2, 2]])  # the null region, then three rooms
    left = np.array([[1, 1], [2, 1], [0, 3], [1, 1]])
    searched = np.array([[False, True, False, False]])
    withheld = np.array([[False, True]])
    view = view_search(cells, left, searched=searched, withheld=withheld, fraction=0.5)
    assert view.inputs[0].tolist() == [[1 + 4 + 0 + 1, 2], [4, 2], [0, 0], [1, 0]]
    assert view.share[0].tolist() == pytest.approx([0.5 * 2 / 3, 0.0, 0.5, 0.5])
    assert view.withheld[0].tolist() == [
        [False, True],
        [False, False],
        [False, True],
        [False, True],
    ]


def test_nothing_is_withheld_once_all_is_searched() -> None:
    cells = np.array([[0], [2], [3]])
    searched, withheld = np.array([[False, True, True]]), np.array([[True]])
    view = view_search(cells, 0 * cells, searched=searched, withheld=withheld, fraction=0.5)
    assert view.inputs[0].tolist() == [[5], [2], [3]]
    assert view.share[0].tolist() == [0.0, 0.0, 0.0]
    assert not view.withheld.any()


def test_training_masks_of_a_search(dataset: Path) -> None:
    stored = MaskedGraphs.fresh(dataset, "train", mask=MaskRecipe(), draw=0)
    graphs = MaskedGraphs.fresh(dataset, "train", mask=MaskRecipe(), draw=0, withhold=0.3)
    searched_any = withheld_any = False
    for plain, one in zip(stored, graphs, strict=True):
        searched = (one.fraction == 0) & ~one.is_building
        searched_any |= bool(searched.any())
        withheld_any |= bool(one.withheld.any())
        assert torch.equal(one.x[searched], one.y[searched])
        assert (one.x[one.withheld & ~one.is_building[:, None]] == 0).all()
        free = ~one.withheld.any(dim=0)
        rest = ~searched & ~one.is_building
        assert torch.equal(one.x[rest][:, free], plain.x[rest][:, free])
        assert int(searched.sum()) <= int((~one.is_building).sum()) // 2
    assert searched_any
    assert withheld_any
    again = MaskedGraphs.fresh(dataset, "train", mask=MaskRecipe(), draw=0, withhold=0.3)
    assert all(torch.equal(a.x, b.x) for a, b in zip(graphs, again, strict=True))


def test_every_number_of_rooms_up_to_half_is_drawn() -> None:
    drawn = [
        sample_search(MaskRecipe(), scene_id="s", draw=d, shape=(8, 45), withhold=0.1)
        for d in range(300)
    ]
    numbers = np.bincount([int(searched.sum()) for searched, _ in drawn], minlength=4)
    assert (numbers > 40).all()
    assert len(numbers) == 4
    assert np.mean([classes.mean() for _, classes in drawn]) == pytest.approx(0.1, abs=0.01)


def test_search_masks_are_fresh_and_uniform() -> None:
    with pytest.raises(ValueError, match="withhold needs"):
        DataConfig(masks="fixed", withhold=0.1)
    with pytest.raises(ValueError, match="withhold needs"):
        DataConfig(mask=MaskRecipe(strategy="rooms"), withhold=0.1)


def fitted(name: str, dataset: Path) -> BeliefModel:
    torch.manual_seed(0)
    data = Dataset.open(dataset)
    model = new_model(ZOO[name], data)
    model.fit(data, ZOO[name].data)
    return model.eval()


@pytest.mark.parametrize("name", ["gamma-poisson", "mixture"])
def test_withholding_is_marginalising(name: str, dataset: Path) -> None:
    """Of a withheld class, and of it alone, all is hidden, as under a mask of share 1."""
    model = fitted(name, dataset)
    rooms = np.random.default_rng(0).poisson(0.7, (5, 45)).astype(float)
    rooms[:, 35] = 0.0  # withheld: no stove is shown anywhere
    inputs = [rooms.sum(axis=0).tolist(), *rooms.tolist()]
    plain = graph(inputs)
    told = graph(inputs)
    told.withheld = torch.zeros(6, 45, dtype=torch.bool)
    told.withheld[:, 35] = True
    absent, unknown = (model.predict(one).presence[1:, 35] for one in (plain, told))
    assert (unknown > absent).all()
    if name == "gamma-poisson":  # the prior alone
        a, b = float(model.shape[35]), float(model.rate[35])  # type: ignore[arg-type, index]
        np.testing.assert_allclose(unknown, 1 - (b / (b + 1)) ** a)


@pytest.mark.parametrize("name", TOLD)
def test_a_withheld_class_is_expected_more_than_one_that_was_not_seen(
    name: str, dataset: Path
) -> None:
    model = fitted(name, dataset)
    (one,) = list(MaskedGraphs.fresh(dataset, "val", mask=MaskRecipe(), draw=0))[:1]
    rooms = ~one.is_building
    one.x[:, 35] = 0
    one.others = torch.zeros(len(one.x), len(model.vocabulary))
    absent = model.predict(one).hidden[rooms.numpy(), 35].copy()
    one.withheld[:, 35] = True
    assert (model.predict(one).hidden[rooms.numpy(), 35] > absent).all()


def test_trees_meet_withheld_classes_and_cannot_be_told(dataset: Path) -> None:
    data = Dataset.open(dataset)
    choice = DataConfig(withhold=0.3)
    masked = sample_chosen(data, choice, draws=2, vocabulary=())
    assert masked.withheld.any()
    assert not sample_uniform(data, choice, draws=2).withheld.any()
    with pytest.raises(ValueError, match="reads"):
        BoostingConfig(reads=("withheld",))  # type: ignore[arg-type]
