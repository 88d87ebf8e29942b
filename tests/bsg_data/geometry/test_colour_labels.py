"""Labels of texels, beside a look at every texel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from bsg_data.geometry.colour_labels import BLACK, FIRST, UNLISTED, ColourLabels, Labels, LabelSheet

COLOURS = ("FF0000", "00FF00")
SHADES = [(255, 0, 0), (0, 255, 0), (0, 0, 0), (9, 9, 9)]
LABELS = [FIRST, FIRST + 1, BLACK, UNLISTED]
pictures = hnp.arrays(
    np.int64, st.tuples(st.integers(1, 5), st.integers(1, 5)), elements=st.integers(0, 3)
)


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
@settings(max_examples=12)  # each makes tables of all colours
@given(picture=pictures)
def test_every_texel_has_the_label_of_its_colour(mode: str, picture: np.ndarray) -> None:
    image = Image.fromarray(np.array(SHADES, dtype=np.uint8)[picture])
    image = image.quantize(8) if mode == "P" else image.convert(mode)
    labels = ColourLabels(COLOURS, None)
    np.testing.assert_array_equal(labels.label(image), np.array(LABELS)[picture])
    counts = [(picture == LABELS.index(label)).sum() for label in range(len(LABELS))]
    assert labels.texels.tolist() == counts
    assert labels.count_unlisted() == int((picture == 3).any())


def test_a_texture_is_labelled_in_bands() -> None:
    """One run may go on from band to band, and each band is counted."""
    picture = np.zeros((1100, 200), dtype=np.int64)
    picture[600:, 100:] = 1
    labels = ColourLabels(COLOURS, None)
    image = Image.fromarray(np.array(SHADES, dtype=np.uint8)[picture])
    np.testing.assert_array_equal(labels.label(image), np.array(LABELS)[picture])
    assert labels.texels.tolist() == [0, 0, 170_000, 50_000]


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


def test_many_faces_on_a_texture_of_many_bands_have_the_labels_under_them() -> None:
    """Changes are summed band by band, and faces are looked at block by block."""
    labels = np.full((1100, 200), 2, dtype=np.uint16)
    labels[600:, 100:] = 3
    labels[::2, :20] = 4  # changes from band to band
    row, column = (grid.ravel() for grid in np.mgrid[0:1100, 0:200])
    spots = np.stack([column, row, column + 1, row, column, row + 1]).reshape(3, 2, -1)
    faces = np.arange(3 * len(row)).reshape(3, -1)
    found, mixed = LabelSheet(labels).find_labels(np.hstack(list(spots)).astype(float), faces)
    np.testing.assert_array_equal(found, labels.ravel())
    change = np.zeros(labels.shape, dtype=bool)
    change[:, 1:] = labels[:, 1:] != labels[:, :-1]
    change[1:] |= labels[1:] != labels[:-1]
    np.testing.assert_array_equal(mixed, change.ravel())
