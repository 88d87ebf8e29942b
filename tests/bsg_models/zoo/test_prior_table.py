"""Scores of presence as distributions of counts, and the tables of common sense that score."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from one_building import observe_building, surround_rooms
from scipy import stats
from scipy.special import expit, logit

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_data.scene.class_space import load_class_space
from bsg_models.errors import ConfigError, TrainingError
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.presence_odds import PresenceOdds, average_others, fit_odds, to_shape
from bsg_models.zoo.prior_table import PriorTableConfig, PriorTableModel, read_prior_table
from bsg_models.zoo.settings import DataConfig, ModelConfig

ODDS, RATE = np.array([-1.0, 0.5]), np.array([2.0, 0.25])
NAMES = ("bed", "stove", "lamp")
ROOMS = {
    "bedroom": {"weight": 3, "presence": {"bed": 0.9, "lamp": 0.8}},
    "kitchen": {"presence": {"stove": 0.95, "lamp": 0.4}},
}
TWICE = b'{"version": 1, "made_by": "us", "made_by": "them"}'
OBJECTS = {"bed": {"lamp": 0.8, "stove": 0.02}, "stove": {"lamp": 0.4}}


def write(folder: Path, **entries: Any) -> str:
    path = folder / "table.json"
    path.write_text(json.dumps({"version": 1, "made_by": "a test", **entries}), "utf-8")
    return str(path)


def make(path: str, *, temper: float = 1.0, trust: float = 0.9) -> PriorTableModel:
    config = PriorTableConfig(table=path, temper=temper, trust=trust)
    model = PriorTableModel(config, ModelInputs(classes=3))
    model.read_knowledge(NAMES)
    return model


@pytest.mark.parametrize("temper", [1.0, 0.5])
def test_the_type_of_a_room_is_bayes_rule_over_the_other_objects(
    tmp_path: Path, temper: float
) -> None:
    model = make(write(tmp_path, room_types=ROOMS, unlisted=0.1), temper=temper)
    seen = observe_building([[1, 0, 0]] * 3 + [[0, 0, 0]], hidden_share=[0.5, 0.5, 0.2, 1.0])
    found = model.score(seen)
    for row, looked in ((1, 0.5), (2, 0.8)):  # of the lamp: a bed is seen, and no stove
        bedroom = 0.75 * (0.9 * 0.9**looked) ** temper
        kitchen = 0.25 * (0.1 * 0.05**looked) ** temper
        lamp = (bedroom * 0.8 + kitchen * 0.4) / (bedroom + kitchen)
        assert found[row, 2] == pytest.approx(logit(lamp) - logit(0.75 * 0.8 + 0.25 * 0.4))
    bedroom, kitchen = 0.75 * 0.2 ** (0.5 * temper), 0.25 * 0.6 ** (0.5 * temper)
    bedroom, kitchen = bedroom * 0.9 ** (0.5 * temper), kitchen * 0.05 ** (0.5 * temper)
    bed = (bedroom * 0.9 + kitchen * 0.1) / (bedroom + kitchen)  # not by the bed itself
    assert found[1, 0] == pytest.approx(logit(bed) - logit(0.75 * 0.9 + 0.25 * 0.1))
    assert np.isnan(found[3]).all()


@pytest.mark.parametrize("trust", [1.0, 0.5])
def test_a_label_is_believed_where_nobody_looked(tmp_path: Path, trust: float) -> None:
    model = make(write(tmp_path, room_types=ROOMS, unlisted=0.1), trust=trust)
    labels = ["kitchen", "garage", None]  # the table does not list garages
    known = surround_rooms([None] * 3, labels)
    found = model.score(
        replace(observe_building([[0, 0, 0]] * 4, hidden_share=1.0), surroundings=known)
    )
    stove = trust * 0.95 + (1 - trust) * (0.75 * 0.1 + 0.25 * 0.95)
    assert found[1, 1] == pytest.approx(logit(stove) - logit(0.75 * 0.1 + 0.25 * 0.95))
    assert np.isnan(found[2:]).all()


def test_objects_speak_in_the_mean_over_what_is_seen(tmp_path: Path) -> None:
    model = make(write(tmp_path, objects=OBJECTS))
    found = model.score(observe_building([[1, 1, 0]] * 2 + [[0, 1, 0], [0, 0, 4]]))
    usual = logit((0.8 + 0.4) / 2)
    assert found[1, 2] == pytest.approx((logit(0.8) + logit(0.4)) / 2 - usual)
    assert found[2, 2] == pytest.approx(logit(0.4) - usual)
    assert np.isnan(found[3]).all()  # the table has no row of what is seen


@pytest.mark.parametrize(
    "entries",
    [
        {},
        {"room_types": {"kitchn": {"presence": {}}}},
        {"room_types": {"kitchen": {"presence": {"stov": 0.5}}}},
        {"objects": {"beds": {"bed": 0.5}}},
        {"objects": {"bed": {"zzqx": 0.5}}},
        {"objects": {"bed": {"lamp": 1.5}}},
        {"room_types": {"kitchen": {"weight": 0, "presence": {}}}},
        {"version": 2, "objects": OBJECTS},
    ],
)
def test_a_table_that_cannot_be_is_refused(tmp_path: Path, entries: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        read_prior_table(write(tmp_path, **entries), NAMES)


@pytest.mark.parametrize("content", [None, b"[]", b"\xff\xfe", b"[" * 5000, TWICE])
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "table.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError):
        read_prior_table(str(path), NAMES)


def test_classes_of_another_space_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, objects={"bed": {"tableware": 0.5}, "tableware": {"bed": 0.5}})
    assert make(path).listed.tolist() == [True, False, False]


def test_the_hand_table_is_sound() -> None:
    classes = load_class_space().classes
    table = read_prior_table("", classes)
    assert "by hand" in table.made_by
    named = {name for room in table.room_types.values() for name in room.presence}
    assert named == set(classes)
    model = PriorTableModel(PriorTableConfig(), ModelInputs(classes=45))
    model.read_knowledge(classes)
    shown = np.zeros((2, 45), dtype=int)
    shown[1, [classes.index("stove"), classes.index("sink")]] = 1
    found = model.score(observe_building(shown.tolist()))[1]
    assert found[classes.index("refrigerator")] > 1 > -1 > found[classes.index("bed")]


@pytest.mark.parametrize("document", ["docs/models.md", "mappings/prior-table-prompt.md"])
def test_the_tables_in_the_documents_are_tables(tmp_path: Path, document: str) -> None:
    text = (REPOSITORY / document).read_text("utf-8")
    shown = re.search(r"^\{\n.*?^\}$", text, re.DOTALL | re.MULTILINE)
    assert shown is not None
    path = tmp_path / "table.json"
    path.write_text(shown[0], "utf-8")
    table = read_prior_table(str(path), load_class_space().classes)
    assert table.room_types["bedroom"].presence["lamp"] == 0.9


class Told(PresenceOdds):
    """Scores the first room 1 for class 0 and −2 for class 1, and says nothing of any other."""

    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Know it already."""

    def score(self, seen: Observation) -> Floats:
        scores = np.full(seen.inputs.shape, np.nan)
        scores[1] = 1.0, -2.0
        return scores


def told(*, slope: float = 0.0) -> Told:
    model = Told(ModelConfig(family="told"), ModelInputs(classes=2))
    model.hold(odds=ODDS, rate=RATE, slope=slope)
    return model


def test_a_room_that_nobody_saw_has_the_prior_moved_by_its_score() -> None:
    model = told(slope=0.5)
    model.hold(centre=[0.4, 0.0])
    inputs = [[0, 0]] * 3
    found = model.predict(observe_building(inputs, hidden_share=1.0))
    np.testing.assert_allclose(found.presence[1], expit(ODDS + np.array([0.5 * 0.6, 0.5 * -2])))
    np.testing.assert_allclose(found.presence[2], expit(ODDS))
    np.testing.assert_allclose(found.hidden[0], found.hidden[1:].sum(axis=0))


@pytest.mark.parametrize(("share", "seen"), [(0.3, 2), (0.3, 0), (1.0, 0)])
def test_what_is_hidden_is_bayes_rule_over_what_is_there(share: float, seen: int) -> None:
    """P(H | V) = P(T = V + H) P(V of T are seen) / P(V), summed over all T."""
    found = told().predict(observe_building([[seen, seen]] * 2, hidden_share=share))
    total = np.arange(400)
    for c, (shape, rate) in enumerate(zip(to_shape(ODDS, RATE), RATE, strict=True)):
        there = stats.nbinom.pmf(total, shape, rate / (1 + rate))
        joint = (there * stats.binom.pmf(seen, total, 1 - np.float32(share)))[seen:]
        posterior = joint / joint.sum()
        for hidden in range(4):
            log_p = found.log_probability(np.full((2, 2), float(hidden)), floor=0.0)[1, c]
            assert np.exp(log_p) == pytest.approx(posterior[hidden])
        assert found.hidden[1, c] == pytest.approx(posterior @ np.arange(len(posterior)))


def test_the_mean_over_others_leaves_out_the_class_itself_and_silence() -> None:
    table = np.array([[9.0, 1.0, 2.0], [3.0, 9.0, np.nan], [5.0, np.nan, 9.0]])
    visible = np.array([[True, True, False], [False, True, False], [False, False, False]])
    found = average_others(visible, table)
    np.testing.assert_array_equal(found[0], [3.0, 1.0, 2.0])
    np.testing.assert_array_equal(found[1], [3.0, np.nan, np.nan])
    assert np.isnan(found[2]).all()


def simulate(slope: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return scores, seen, hidden and shares of 4000 rooms that keep the model."""
    rng = np.random.default_rng(0)
    scores = rng.normal(0, 2, (4000, 2))
    there = rng.poisson(rng.gamma(to_shape(ODDS + slope * scores, RATE)) / RATE)
    share = rng.uniform(0.1, 0.9, 4000)
    hidden = rng.binomial(there, share[:, None])
    return scores, (there - hidden).astype(float), hidden.astype(float), share


def test_the_fit_finds_what_rooms_were_made_with() -> None:
    scores, seen, hidden, share = simulate(0.4)
    odds, rate, slope = fit_odds(scores, seen, hidden, share, prior=np.ones((2, 2)))
    assert slope == pytest.approx(0.4, abs=0.03)
    np.testing.assert_allclose(odds, ODDS, atol=0.15)
    np.testing.assert_allclose(rate, RATE, rtol=0.15)


def test_a_score_that_misleads_is_left_out() -> None:
    scores, seen, hidden, share = simulate(0.4)
    assert fit_odds(-scores, seen, hidden, share, prior=np.ones((2, 2)))[2] == 0.0


@pytest.mark.parametrize("fractions", [None, (0.0, 0.0)])
def test_masks_that_hide_nothing_are_refused(
    dataset: Path, fractions: tuple[float, float] | None
) -> None:
    model = Told(ModelConfig(family="told"), ModelInputs(classes=45))
    choice = DataConfig(mask=MaskRecipe(fraction=0.0), fractions=fractions)
    with pytest.raises(TrainingError):
        model.fit(Dataset.open(dataset), choice)
