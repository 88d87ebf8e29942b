"""What planners save, by hand, against a naive bootstrap, and of a planner of somebody else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from bsg_data.arrays import Ints
from bsg_data.dataset.dataset import read_cells
from bsg_data.errors import RecipeError
from bsg_models.search.catalogue import PLANNERS, Planner
from bsg_models.search.knowledge import Knowledge
from bsg_models.search.planners import nearest
from bsg_models.search.simulator import Outcome
from bsg_models.studies.savings import saving_of_buildings, summarise
from bsg_models.studies.search_cases import StudyRecipe
from bsg_models.studies.search_study import Searches, Study, choose_planners, study_search


def by_hand(scene: str, nearest: list[float], ours: list[float]) -> Searches:
    number = len(nearest)
    outcomes = {
        ("single", name): Outcome(np.array(costs), np.ones(number, int), np.zeros(number, int))
        for name, costs in {"nearest": nearest, "ratio": ours, "routing": nearest}.items()
    }
    whole = np.zeros(number, dtype=np.int64)
    return Searches(
        scene_id=scene,
        world="star:1-10",
        starts=whole,
        artifacts=whole[:, None],
        draws=whole,
        instances=whole + 1,
        ranked_first=whole + 1.0,
        chance=whole + 0.5,
        outcomes=outcomes,  # type: ignore[arg-type]
    )


def test_savings_by_hand() -> None:
    searches = (by_hand("a", [4.0, 6.0], [2.0, 6.0]), by_hand("b", [10.0], [15.0]))
    recipe = StudyRecipe(tasks=("single",))
    planners = choose_planners(recipe, {}, remote=False)
    (one,) = summarise(Study(recipe, ("a", "b"), searches, {}, planners), resamples=500)
    ratio = one.savings["ratio"]
    assert ratio.saved.value == pytest.approx(1 - 23 / 20)
    assert np.isnan(ratio.saved.low)  # of two buildings there is no interval
    (many,) = summarise(Study(recipe, (), searches * 3, {}, planners), resamples=2000)
    low, high = many.savings["ratio"].saved.low, many.savings["ratio"].saved.high
    assert many.savings["ratio"].saved.value == ratio.saved.value
    assert low == pytest.approx(1 - (8 + 5 * 15) / (10 + 5 * 10))  # five of six are b
    assert high == pytest.approx(1 - (5 * 8 + 15) / (5 * 10 + 10))
    assert ratio.mean == pytest.approx((0.5 + 0.0 - 0.5) / 3)
    assert ratio.median == 0.0
    assert (ratio.wins, ratio.ties, ratio.losses) == (1, 1, 1)
    assert ratio.beyond_routing.value == pytest.approx(ratio.saved.value)
    assert np.isnan(ratio.of_oracle.value)
    assert np.isnan(one.savings["nearest"].beyond_routing.value)
    assert (one.searches, one.buildings, one.ranked_first, one.chance) == (3, 2, 1.0, 0.5)
    assert saving_of_buildings(searches, "single", "ratio") == pytest.approx([0.2, -0.5])


def test_an_interval_is_scipys_percentile_bootstrap() -> None:
    rng = np.random.default_rng(0)
    costs = rng.uniform(5, 20, (40, 2)) * np.array([1.0, 0.8])
    searches = tuple(by_hand(f"{i}", [base], [ours]) for i, (base, ours) in enumerate(costs))
    recipe = StudyRecipe(tasks=("single",))
    planners = choose_planners(recipe, {}, remote=False)
    (one,) = summarise(Study(recipe, (), searches, {}, planners), resamples=4000)
    theirs = stats.bootstrap(
        (costs[:, 0], costs[:, 1]),
        lambda base, ours, axis: 1 - ours.sum(axis=axis) / base.sum(axis=axis),
        paired=True,
        method="percentile",
        n_resamples=4000,
        rng=np.random.default_rng(1),
    ).confidence_interval
    saved = one.savings["ratio"].saved
    assert saved.low == pytest.approx(theirs.low, abs=0.01)
    assert saved.high == pytest.approx(theirs.high, abs=0.01)
    assert saved.nodes == one.searches == 40


def contrary(known: Knowledge) -> Ints:
    """Go to the unexplored room that is farthest away."""
    return np.where(known.unexplored, known.distance, -1.0).argmax(axis=1)


def test_a_planner_of_ones_own_meets_the_same_searches(dataset: Path) -> None:
    recipe = StudyRecipe(planners=("routing",), episodes=10)
    runs = dict.fromkeys(list(read_cells(dataset))[-5:])
    own = {"mine": Planner(nearest, "none"), "contrary": Planner(contrary, "none")}
    study = study_search(dataset, runs, recipe, planners=own)
    alone = study_search(dataset, runs, recipe)
    assert list(study.planners) == ["nearest", "routing", "mine", "contrary"]
    for one, two in zip(summarise(study), summarise(alone), strict=True):
        assert list(one.savings) == list(study.planners)
        assert one.savings["mine"].saved.value == 0
        assert one.savings["contrary"].saved.value < 0
        assert np.isnan(one.savings["mine"].beyond_routing.value)  # it reads no belief
        assert one.savings["routing"].saved == two.savings["routing"].saved


def test_a_planner_of_ones_own_that_cannot_be_asked_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recipe = StudyRecipe(planners=("routing",))
    for name in ("nearest", "sweep", "stop 0.1"):
        with pytest.raises(RecipeError, match=f"'{name}': this name is taken"):
            choose_planners(recipe, {name: Planner(contrary)}, remote=False)
    local = {"mine": Planner(lambda known: known.here, "none")}
    installed = recipe.model_copy(update={"planners": ("sweep",)})
    monkeypatch.setitem(PLANNERS._rows, "sweep", PLANNERS._rows["nearest"])
    with pytest.raises(RecipeError, match="'sweep': this name is taken"):
        choose_planners(installed, {}, remote=False)
    assert "mine" in choose_planners(recipe, local, remote=False)
    with pytest.raises(RecipeError, match="other processes cannot import"):
        choose_planners(recipe, local, remote=True)
    assert "mine" in choose_planners(recipe, {"mine": Planner(contrary)}, remote=True)
    believing = choose_planners(recipe, {"mine": Planner(contrary, "belief")}, remote=False)
    assert list(believing) == ["nearest", "routing", "mine"]
