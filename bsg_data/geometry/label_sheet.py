"""The labels of a texture, and the number of labels on a triangle of it."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.geometry.colour_labels import Labels
from bsg_data.geometry.triangles import find_spans, take_corners


class LabelSheet:
    """The labels of a texture.

    Attributes:
        labels: `[H, W]`.
    """

    def __init__(self, labels: Labels) -> None:
        self.labels = labels
        self._changes = _sum_changes(labels)

    def find_labels(self, spots: Floats, faces: Ints) -> tuple[Labels, Bools]:
        """Return the label at a corner of every face, and whether its texels may differ.

        Args:
            spots: column and row of the vertices `[2, V]`, in texels.
            faces: `[3, F]`.
        """
        bounds, beyond = [], np.zeros(faces.shape[1], dtype=bool)
        for axis, size in ((1, self.labels.shape[0]), (0, self.labels.shape[1])):
            low, high = (
                side[0] for side in find_spans(*take_corners(spots[axis : axis + 1], faces))
            )
            turns = np.floor(low / size) * size  # textures repeat
            first = np.minimum((low - turns).astype(np.int32), size - 1)
            last = np.maximum(np.ceil(high - turns).astype(np.int32), first + 1)
            beyond |= last > size
            bounds += [first, np.minimum(last, size)]
        top, below, left, right = bounds
        sums = self._changes
        inside = sums[below, right] - sums[top, right] - sums[below, left] + sums[top, left]
        return self.labels[top, left], beyond | (inside > 0)


def _sum_changes(labels: Labels) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    """Return the number of texels above and left of each, which differ from the one before them."""
    height, width = labels.shape
    change = np.zeros(labels.shape, dtype=bool)
    change[:, 1:] = labels[:, 1:] != labels[:, :-1]
    change[1:] |= labels[1:] != labels[:-1]
    # Changes are few: how many there were up to each texel is quicker repeated than summed.
    places = np.flatnonzero(change)
    gaps = np.diff(places, prepend=0, append=change.size)
    until = np.repeat(np.arange(len(gaps), dtype=np.int32), gaps).reshape(labels.shape)
    sums = np.zeros((height + 1, width + 1), dtype=np.int32)
    sums[1:, 1:] = until
    sums[2:, 1:] -= until[:-1, -1:]
    for row in range(1, len(sums)):  # a cumsum down the columns takes ten times as long
        sums[row] += sums[row - 1]
    return sums
