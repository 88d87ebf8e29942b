from __future__ import annotations

import pytest

from bsg_data.recipes import MaskRecipe
from bsg_models.errors import ConfigError
from bsg_models.studies.leaderboard_runs import (
    LeaderboardRecipe,
    Place,
    fit_to,
    plan_runs,
    trained_on,
)
from bsg_models.training.training import member_config
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.settings import DataConfig

UNIFORM = LeaderboardRecipe(masks=("uniform",))
MIXED = ("data.mask.strategy=mixed", "data.mask.withhold=0.05")


def configure(name: str, *settings: str) -> RunConfig:
    tables = override(find_config(name).model_dump(mode="json"), settings)
    return validate_config(tables, source="test")


PLAIN = ("data.mask.strategy=uniform", "data.mask.withhold=0.0")  # whose mask is to be set
PAIR = configure("ensemble", 'model.members=["gamma-poisson","train-mean"]', *PLAIN)


def test_a_member_that_is_there_in_another_configuration_is_trained_once_more() -> None:
    single, ensembles, members = plan_runs({"pair": PAIR}, UNIFORM)
    assert {place.name for place in single} == {"gamma-poisson", "train-mean"}
    assert {place.name for place in ensembles} == {"pair"}
    seeded = configure("ensemble", 'model.members=["train-mean"]', *PLAIN, "seed=3")
    planned = plan_runs({"seeded": seeded}, UNIFORM).single
    assert planned[Place("uniform", "train-mean")].seed == 3
    assert members == {
        Place("uniform", "pair"): {"gamma-poisson": "gamma-poisson", "train-mean": "train-mean"}
    }
    taken = {"seeded": seeded, "train-mean": find_config("train-mean")}
    runs = plan_runs(taken, UNIFORM)
    assert runs.single[Place("uniform", "train-mean")] == taken["train-mean"]
    assert runs.single[Place("uniform", "seeded+train-mean")].seed == 3
    assert runs.members == {Place("uniform", "seeded"): {"train-mean": "seeded+train-mean"}}
    with pytest.raises(ConfigError, match="'seeded\\+train-mean' is the name of a run"):
        plan_runs(taken | {"seeded+train-mean": find_config("input")}, UNIFORM)


def test_every_model_has_a_place_for_each_kind_of_mask_or_one_of_its_own() -> None:
    models = {
        "ceci-sage": find_config("ceci-sage"),
        "any": configure("ceci-sage", *MIXED),
        "mixture": find_config("mixture"),
        "ensemble": configure("ensemble", 'model.members=["mixture","ceci-sage"]', *MIXED),
    }
    runs = plan_runs(models, LeaderboardRecipe(masks=("uniform", "explore")))
    assert set(runs.single) == {
        Place("uniform", "ceci-sage"),
        Place("explore", "ceci-sage"),
        Place("uniform", "mixture"),
        Place("explore", "mixture"),
        Place("mixed", "any"),
        Place("mixed", "mixture"),  # of the ensemble
        Place("mixed", "ceci-sage"),
    }
    assert set(runs.ensembles) == {Place("mixed", "ensemble")}
    assert set(runs.masks) == {"uniform", "explore", "mixed"}
    assert [trained_on(models["any"], mask) for mask in ("uniform", "mixed")] == ["mixed"] * 2


def test_a_run_that_an_ensemble_needs_and_the_leaderboard_has_is_one() -> None:
    """The member is trained on the mask of the ensemble, as the model of the same name is."""
    trained = configure("ceci-sage", *MIXED)
    ensemble = configure("ensemble", 'model.members=["ceci-sage"]', *MIXED)
    runs = plan_runs({"ceci-sage": trained, "one": ensemble}, UNIFORM)
    assert runs.single == {Place("mixed", "ceci-sage"): trained}
    recipe = LeaderboardRecipe(seed=7)
    fitted = fit_to(ensemble, recipe, mask="mixed", fold=1)
    assert member_config(fitted, "ceci-sage") == fit_to(trained, recipe, mask="mixed", fold=1)


def test_a_leaderboard_of_mixed_masks_has_both_kinds_of_them() -> None:
    mixed = LeaderboardRecipe(masks=("mixed",))
    ensemble = configure("ensemble", 'model.members=["mixture"]', *MIXED)
    runs = plan_runs({"mixture": find_config("mixture"), "one": ensemble}, mixed)
    own, needed = (runs.single[Place("mixed", name)].data for name in ("mixture", "one+mixture"))
    assert (own.mask.withhold, needed.mask.withhold) == (0.0, 0.05)
    zoo = plan_runs({name: find_config(name) for name in ZOO}, mixed)
    assert zoo.members[Place("mixed", "ensemble")]["mixture"] == "ensemble+mixture"
    plain = configure("ensemble", 'model.members=["mixture"]', MIXED[0], PLAIN[1])
    assert len(plan_runs({"mixture": find_config("mixture"), "one": plain}, mixed).single) == 1


def test_the_leaderboard_sets_the_mask_of_those_that_have_none() -> None:
    recipe = LeaderboardRecipe(fraction=0.3, seed=7)
    fitted = fit_to(find_config("ceci-sage"), recipe, mask="rooms", fold=2)
    assert fitted.data.mask == MaskRecipe(strategy="rooms", fraction=0.3, seed=7)
    assert (fitted.data.fold, fitted.seed) == (2, 7)
    own = fit_to(configure("ceci-sage", *MIXED, "data.mask.seed=1"), recipe, mask="rooms", fold=2)
    assert own.data.mask == MaskRecipe(strategy="mixed", withhold=0.05, seed=8)
    # Its checkpoint is read again: what a search withholds is in the mask then.
    searching = configure("ceci-sage", "data.withhold=0.08")
    fitted = fit_to(searching, recipe, mask="rooms", fold=0)
    assert fitted.data.mask.withhold == 0.08
    assert DataConfig.model_validate(fitted.data.model_dump()) == fitted.data
