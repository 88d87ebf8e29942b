"""The table of what meets: its rows, its two rules by hand, and the script that counts it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from one_building import observe_building

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_space import load_class_space, read_published
from bsg_models.zoo.cooccurrence import BEHAVIOR_TABLE, Cooccurrence, CooccurrenceConfig, read_table
from bsg_models.zoo.model import ModelInputs

HEADER = "class_a,class_b,rooms_with_both,rooms_with_a,rooms_with_b,rooms\n"
NAMES = ("bed", "pillow", "stove", "bike")
TABLE = HEADER + "bed,pillow,8,10,12,40\nbed,lamp,9,10,30,40\nlamp,stove,4,30,5,40\n"
S = 2.0


def make(rule: str, table: str = TABLE) -> Cooccurrence:
    config = CooccurrenceConfig(rule=rule, smoothing=S)  # type: ignore[arg-type]
    model = Cooccurrence(config, ModelInputs(classes=4))
    together, rooms = read_table("t.csv", table.encode(), NAMES)
    model.together.copy_(torch.from_numpy(together))
    model.rooms.fill_(rooms)
    return model


def usual(number: int) -> float:
    return (number + S / 2) / (40 + S)


def given(both: float, c: int, j: int) -> float:
    """Return P(c | j)."""
    return (both + S * usual(c)) / (j + S)


def test_the_table_has_pairs_and_single_classes() -> None:
    together, rooms = read_table("t.csv", TABLE.encode(), NAMES)
    assert rooms == 40
    # Bed and stove are listed and do not meet, which counts as one room; the bike is not listed.
    assert together.tolist() == [[10, 8, 1, 0], [8, 12, 1, 0], [1, 1, 5, 0], [0, 0, 0, 0]]


def test_pmi_is_the_mean_over_what_is_seen() -> None:
    seen = observe_building([[1, 1, 0, 0]] * 2 + [[2, 0, 0, 1], [0, 0, 0, 5]])
    found = make("pmi").score(seen)
    of_bed, of_pillow = (np.log(given(1, 5, n) / usual(5)) for n in (10, 12))
    assert found[1, 2] == pytest.approx((of_bed + of_pillow) / 2)
    assert found[1, 0] == pytest.approx(np.log(given(8, 10, 12) / usual(10)))
    assert found[2, 1] == pytest.approx(np.log(given(8, 12, 10) / usual(12)))
    assert np.isnan(found[2, 0])  # only itself is seen, of what is listed
    assert np.isnan(found[3]).all()


def test_naive_bayes_weighs_what_is_absent_by_the_share_that_was_seen() -> None:
    seen = observe_building([[1, 0, 0, 0]] * 2 + [[0] * 4] * 2, hidden_share=[0.5, 0.25, 0.25, 1.0])
    found = make("naive-bayes").score(seen)

    def ratio(both: float, j: int, c: int) -> tuple[float, float]:
        """Return what j says of c where it is seen, and where it is absent."""
        there, without = given(both, j, c), (j - both + S * usual(j)) / (40 - c + S)
        return np.log(there / without), np.log((1 - there) / (1 - without))

    bed, pillow = ratio(1, 10, 5), ratio(1, 12, 5)
    assert found[1, 2] == pytest.approx(bed[0] + 0.75 * pillow[1])
    assert found[2, 2] == pytest.approx(0.75 * (bed[1] + pillow[1]))
    assert np.isnan(found[3]).all()
    assert np.isnan(found[:, 3]).all()
    withheld = replace(seen, withheld=np.tile([False, True, False, False], (4, 1)))
    assert make("naive-bayes").score(withheld)[1, 2] == pytest.approx(bed[0])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("bed,pillow,many,10,12,40\n", "line 2: expected whole numbers"),
        ("bed,pillow,11,10,12,40\n", "line 2: expected two classes, and 0 < both"),
        ("bed,pillow,1,10,99,40\n", "line 2: .* found bed, pillow, 1, 10, 99, 40"),
        ("bed,bed,1,10,10,40\n", "line 2: expected two classes"),
        ("bed,pillow,1\n", "line 2: expected 6 fields"),
    ],
)
def test_a_row_that_cannot_be_is_named(rows: str, message: str) -> None:
    with pytest.raises(ClassMapError, match=rf"t\.csv, {message}"):
        read_table("t.csv", (HEADER + rows).encode(), NAMES)


def test_the_published_table_is_sound() -> None:
    classes = load_class_space().classes
    together, rooms = read_table(BEHAVIOR_TABLE, read_published(BEHAVIOR_TABLE), classes)
    assert rooms == 330
    listed = together.diagonal() > 0
    assert listed.sum() == 38
    without = {classes[c] for c in np.flatnonzero(~listed)}
    assert without >= {"curtain", "dresser", "towel", "wardrobe"}
    np.testing.assert_array_equal(together, together.T)
    bed, stove = classes.index("bed"), classes.index("stove")
    model = Cooccurrence(CooccurrenceConfig(), ModelInputs(classes=45))
    model.read_knowledge(classes)
    shown = np.zeros((2, 45), dtype=int)
    shown[1, classes.index("pillow")] = 1
    scores = model.score(observe_building(shown.tolist()))
    assert scores[1, bed] > 1 > 0 > scores[1, stove]
