"""The documents of a leaderboard, by hand: paired comparisons, what is in bold, every metric."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.manifest import ClassMapEntry, Manifest, SourceEntry, Totals
from bsg_data.errors import DatasetError
from bsg_data.scene.class_map import load_class_map
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.catalogue import list_values
from bsg_models.studies.leaderboard import Leaderboard, LeaderboardRecipe, ModelResult
from bsg_models.studies.leaderboard_report import (
    REPORT,
    compare,
    rank_models,
    refuse_finished,
    write_json,
    write_markdown,
)

RECIPE = LeaderboardRecipe(folds=3, draws=2, resamples=3)


def board(values: Mapping[str, float]) -> Leaderboard:
    """Return a leaderboard on which every metric of a model is one number."""
    names = list_values()
    noise = np.array([-0.1, 0.0, 0.1])
    results = {
        model: ModelResult(
            Bootstrap(
                point=dict.fromkeys(names, value),
                resampled=dict.fromkeys(names, value + noise),
                nodes=dict.fromkeys(names, 7),
            ),
            seconds=1.5,
        )
        for model, value in values.items()
    }
    class_map = load_class_map()
    source = SourceEntry(
        kind="hm3d", version=None, fingerprint="0", class_map=ClassMapEntry.of(class_map)
    )
    manifest = Manifest(
        generator="test",
        class_space=class_map.space,
        sources=(source,),
        scenes_per_shard=16,
        totals=Totals(scenes=3, rooms=9),
        files=(),
    )
    return Leaderboard(RECIPE, manifest, {"rooms": results})


def test_paired_comparisons_by_hand() -> None:
    """The noise of two models is the same, so that their difference has none."""
    made = board({"train-mean": 0.5, "gamma-poisson": 0.4, "ours": 0.3})
    results = made.results["rooms"]
    assert rank_models(results) == ["ours", "gamma-poisson", "train-mean"]
    found = compare(results, "ours")
    difference = found["unvisited_ap_minus_train_mean"]
    assert difference is not None
    assert (difference.value, difference.low, difference.high) == pytest.approx((-0.2,) * 3)
    ratio = found["nll_over_gamma_poisson"]
    assert ratio is not None
    assert ratio.value == pytest.approx(0.75)
    assert ratio.low < ratio.value < ratio.high
    alone = board({"ours": 0.3}).results["rooms"]
    assert compare(alone, "ours")["nll_over_gamma_poisson"] is None


def test_a_model_of_a_hostile_name_is_no_markup() -> None:
    evil = "<b>`|[x](y)"
    made = board({"train-mean": 0.5, evil: 0.3})
    made.results["rooms"][evil] = replace(made.results["rooms"][evil], trained_on=evil)
    space = made.manifest.class_space.model_copy(update={"name": evil})
    text = write_markdown(
        replace(
            made,
            manifest=made.manifest.model_copy(update={"class_space": space}),
            results={evil: made.results["rooms"]},
        )
    )
    escaped = r"&lt;b&gt;\`\|\[x\](y)"
    assert text.count(escaped) > 5
    assert "<b>" not in text
    assert "[x](y)" not in text.replace(escaped, "")
    assert f"## Masks: {escaped}" in text
    assert f"| {escaped} | " in text


def test_a_model_with_a_mask_of_its_own_is_trained_once_by_each_seed() -> None:
    made = board({"train-mean": 0.5, "ours": 0.3})
    results = made.results["rooms"]
    results["ours"] = replace(results["ours"], trained_on="mixed", seeds=3)
    assert "`ours` was trained once, on `mixed` masks" in write_markdown(made)
    seeded = replace(made, recipe=RECIPE.model_copy(update={"seed": 7, "seeds": 3}))
    text = write_markdown(seeded)
    assert "`ours` was trained on `mixed` masks" in text
    assert "by 3 seeds, 7 to 9; `train-mean` once" in text
    assert "show 67 % of the variance" in text


def test_the_documents_say_the_same_as_the_board() -> None:
    made = board({"train-mean": 0.5, "gamma-poisson": 0.4, "ours": 0.3})
    text = write_markdown(made)
    row = next(line for line in text.splitlines() if line.startswith("| ours | **0.3 ± 0.095**"))
    assert row.count("**0.3 ± 0.095**") == 2  # less is better for two of seven
    assert "0.75 ± " in row
    assert "| ours | 0.3 ± 0.095 |" in text  # unvisited: more is better, and it is the least
    assert "NLL, rooms is `rooms/hidden_nll`" in text
    twins = board({"one": 0.3, "other": 0.3})
    assert write_markdown(twins).count("**0.3 ± 0.095**") == 2 * (7 + 4)  # of a tie, both
    found = json.loads(json.dumps(write_json(made)))
    nll = found["masks"]["rooms"]["ours"]["metrics"]["rooms/hidden_nll"]
    assert nll == {
        "value": 0.3,
        "low": pytest.approx(0.205),
        "high": pytest.approx(0.395),
        "nodes": 7,
    }
    assert found["dataset"]["scenes"] == 3
    assert all(f"| `{name}` |" in text for name in list_values())


def test_a_finished_leaderboard_is_replaced_by_force_alone(tmp_path: Path) -> None:
    refuse_finished(tmp_path, force=False)
    (tmp_path / REPORT).write_text("{}")
    refuse_finished(tmp_path, force=True)
    with pytest.raises(DatasetError):
        refuse_finished(tmp_path, force=False)
