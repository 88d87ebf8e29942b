"""The page and the JSON of a leaderboard, by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.manifest import ClassMapEntry, Manifest, SourceEntry, Totals
from bsg_data.errors import DatasetError
from bsg_data.scene.class_map import load_class_map
from bsg_data.seal import write_seal
from bsg_models.evaluation.bootstrap import Bootstrap
from bsg_models.evaluation.catalogue import list_values
from bsg_models.studies.leaderboard import Leaderboard, LeaderboardRecipe, ModelResult
from bsg_models.studies.leaderboard_report import (
    REPORT,
    refuse_finished,
    report_leaderboard,
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


def test_the_page_says_how_models_were_trained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plot = "bsg_models.studies.leaderboard_report.plot_leaderboard"
    monkeypatch.setattr(plot, lambda *given, **_: given[2].write_bytes(b""))  # it takes seconds
    made = board({"train-mean": 0.5, "gamma-poisson": 0.4, "ours": 0.3})
    results = made.results["rooms"]
    results["ours"] = replace(results["ours"], trained_on="mixed", seeds=3)
    seeded = replace(made, recipe=RECIPE.model_copy(update={"seed": 7, "seeds": 3}))
    report = report_leaderboard(seeded, tmp_path)
    page = report.page.read_text("utf-8")
    assert "One model in every table: ours (mixed masks)." in page
    assert "means over the folds and 3 seeds" in page
    assert "0.3 ±0.095" in page
    assert "0.75 ±" in page  # of gamma-poisson's likelihood
    nll = report.summary["masks"]["rooms"]["ours"]["metrics"]["rooms/hidden_nll"]
    ends = {"low": pytest.approx(0.205), "high": pytest.approx(0.395)}
    assert nll == {"value": 0.3, "nodes": 7, **ends}
    assert report.summary["dataset"]["scenes"] == 3


def test_a_finished_leaderboard_is_replaced_by_force_alone(tmp_path: Path) -> None:
    refuse_finished(tmp_path, force=False)
    (tmp_path / REPORT).write_text("{}")
    with pytest.raises(DatasetError):  # of somebody else
        refuse_finished(tmp_path, force=False)
    (tmp_path / "rooms" / "dataset").mkdir(parents=True)
    (tmp_path / "rooms" / "dataset" / "dataset.json").touch()
    refuse_finished(tmp_path, force=False)  # of a leaderboard that was killed before its seal
    write_seal(tmp_path, [REPORT])
    refuse_finished(tmp_path, force=True)
    with pytest.raises(DatasetError):
        refuse_finished(tmp_path, force=False)
