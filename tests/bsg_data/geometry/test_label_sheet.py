"""Which triangles lie on texels of one label, beside a look at every texel."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from bsg_data.geometry.colour_labels import Labels
from bsg_data.geometry.label_sheet import LabelSheet

sheets = hnp.arrays(
    np.uint16,
    st.tuples(st.integers(1, 6), st.integers(1, 6)),
    elements=st.sampled_from([2, 2, 2, 2, 3]),
)
places = hnp.arrays(np.float64, (2, 3), elements=st.integers(-8, 30).map(lambda n: n / 4))


@given(labels=sheets, spots=places)
def test_a_triangle_that_is_not_mixed_has_one_label(labels: Labels, spots: np.ndarray) -> None:
    (found,), (mixed,) = LabelSheet(labels).find_labels(spots, np.array([[0], [1], [2]]))
    columns, rows = (
        np.arange(int(np.floor(axis.min())), max(int(np.ceil(axis.max())), int(axis.min()) + 1))
        for axis in spots
    )
    under = labels[np.ix_(rows % labels.shape[0], columns % labels.shape[1])]
    assert found in under
    if not mixed:
        assert (under == found).all()


def test_a_triangle_on_one_label_is_whole() -> None:
    labels = np.full((8, 8), 2, dtype=np.uint16)
    labels[:, 5:] = 3
    left = np.array([[1.0, 4.5, 1.0], [1.0, 1.0, 7.0]])
    right = np.array([[5.5, 7.5, 6.0], [1.0, 1.0, 7.0]])
    across = np.array([[1.0, 7.5, 6.0], [1.0, 1.0, 7.0]])
    spots = np.concatenate([left, right, across], axis=1)
    found, mixed = LabelSheet(labels).find_labels(spots, np.arange(9).reshape(3, 3).T)
    assert found[:2].tolist() == [2, 3]
    assert mixed[0] == 0
    assert mixed[2] == 1
