"""The instance of each texel, vertex or triangle of a mesh, by its exact colour."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.arrays import Bools, Floats, Ints, find_runs
from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.surfaces import Labels, find_spans, take_corners

UNLISTED, BLACK, FIRST = 0, 1, 2  # two labels that are no instance; that of the first instance
MAX_INSTANCES = 60_000
_ROWS = 512  # of a texture at once: a texture of noise has as many runs as texels


class ColourLabels:
    """The label of every colour, and how many texels had which."""

    def __init__(self, colours: Sequence[str | None], snap: int | None) -> None:
        if len(colours) > MAX_INSTANCES:
            raise MeshError(f"{len(colours):,} instances; at most {MAX_INSTANCES:,} are told apart")
        known = {place: int(one, 16) for place, one in enumerate(colours, FIRST) if one is not None}
        self._known = np.array(list(known), dtype=np.uint16)  # labels of instances with a colour
        codes = np.array(list(known.values()), dtype=np.int64)
        self._rgb = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], axis=1)
        self._labels = np.zeros(2**24, dtype=np.uint16)
        self._labels[0] = BLACK
        self._labels[_codes(self._rgb)] = self._known
        self._unlisted = np.zeros(2**24, dtype=bool)
        self._snap = snap
        self.texels: Ints = np.zeros(FIRST + len(colours), dtype=np.int64)  # of each label
        self.snapped = 0  # texels of JPEG textures that were near to a listed colour, and not it

    def label(self, image: Image.Image) -> Labels:
        """Return the label of every texel `[H, W]` by its exact colour.

        Neighbours mostly have the same colour: a run of them is looked up once.
        """
        if image.format == "JPEG":
            return self._snap_jpeg(image)
        pixels, palette = _unpack(image)
        labels = np.empty(pixels.shape, dtype=np.uint16)
        for row in range(0, len(pixels), _ROWS):
            some = pixels[row : row + _ROWS]
            starts, values = find_runs(some.ravel())
            named = self._look_up(values, palette)
            lengths = np.diff(starts, append=some.size)
            self._count(named, lengths)
            labels[row : row + _ROWS] = np.repeat(named, lengths).reshape(some.shape)
        return labels

    def label_vertices(self, colours: npt.NDArray[np.uint8]) -> Labels:
        """Return the label of every vertex `[V]`."""
        return self._look_up(_codes(colours), None)

    def count_unlisted(self) -> int:
        """Return how many colours were met that no instance has."""
        return int(self._unlisted.sum())

    def _look_up(
        self,
        values: npt.NDArray[np.unsignedinteger],
        palette: npt.NDArray[np.uint32] | None,
    ) -> Labels:
        """Return the label of values: places in a palette, or codes without one.

        A place beyond the palette has no colour: it is unlisted, and no colour that was met.
        """
        there = np.ones(len(values), dtype=bool) if palette is None else values < len(palette)
        codes = values[there] & 0xFFFFFF if palette is None else palette[values[there]]
        labels = np.full(len(values), UNLISTED, dtype=np.uint16)
        labels[there] = found = self._labels[codes]
        self._unlisted[codes[found == UNLISTED]] = True
        return labels

    def _count(self, labels: Labels, texels: Ints) -> None:
        counted = np.bincount(labels, texels, minlength=len(self.texels))  # exact up to 2⁵³
        self.texels += counted.astype(np.int64)

    def _snap_jpeg(self, image: Image.Image) -> Labels:
        from scipy.spatial import cKDTree  # slow to import, and JPEG is rare

        if self._snap is None:
            raise MeshError(
                "a texture is JPEG, which changes colours, so that texels no longer say "
                "which instance they are; --option snap_colours=N takes the nearest listed colour "
                "within N"
            )
        codes, index, counts = np.unique(
            _unpack(image)[0] & 0xFFFFFF, return_inverse=True, return_counts=True
        )
        rgb = np.stack([codes & 255, codes >> 8 & 255, codes >> 16], axis=1)
        _, nearest = cKDTree(self._rgb).query(rgb, p=np.inf, distance_upper_bound=self._snap + 0.5)
        exact = self._labels[codes]
        near = nearest < len(self._known)
        named = np.append(self._known, UNLISTED)[nearest]  # a texel near to none gets the last
        labels = np.where(near, named, exact).astype(np.uint16)
        self._unlisted[codes[labels == UNLISTED]] = True
        self.snapped += int(counts[near & (exact < FIRST)].sum())
        self._count(labels, counts)
        return labels[index].reshape(image.height, image.width)


class LabelSheet:
    """The labels of a texture `[H, W]`."""

    def __init__(self, labels: Labels) -> None:
        self.labels = labels
        self._changes = _sum_changes(labels)

    def find_labels(self, spots: Floats, faces: Ints) -> tuple[Labels, Bools]:
        """Return the label at a corner of every face `[3, F]`, and whether its texels may differ.

        The `spots` `[2, V]` are column and row of the vertices, in texels.
        """
        height, width = self.labels.shape
        halves = (np.floor(spots) + np.ceil(spots)).astype(np.int64)  # odd within a texel
        bounds, beyond = [], np.zeros(faces.shape[1], dtype=bool)
        for axis, size in ((1, height), (0, width)):
            low, high = find_spans(*take_corners(halves[axis], faces))
            first = low >> 1
            turns = first // size * size  # textures repeat
            first -= turns
            last = np.maximum((high + 1 >> 1) - turns, first + 1)
            beyond |= last > size
            bounds += [first, np.minimum(last, size, out=last)]
        top, below, left, right = bounds
        sums, above, under = self._changes, top * (width + 1), below * (width + 1)
        inside = sums.take(under + right) - sums.take(above + right)
        inside += sums.take(above + left) - sums.take(under + left)
        return self.labels.take(top * width + left), beyond | (inside > 0)


def _codes(rgb: npt.NDArray[np.generic]) -> npt.NDArray[np.uint32]:
    """Return colours `[..., 3]` as whole numbers, red lowest: the order of bytes in memory."""
    red, green, blue = (rgb[..., channel].astype(np.uint32) for channel in range(3))
    return np.asarray(red | green << 8 | blue << 16, dtype=np.uint32)


def _unpack(
    image: Image.Image,
) -> tuple[npt.NDArray[np.unsignedinteger], npt.NDArray[np.uint32] | None]:
    """Return the pixels `[H, W]`, codes or places in a palette, with the codes of that palette."""
    if image.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA"):
        raise MeshError(f"a texture has mode {image.mode}; expected 8 bits a channel")
    try:
        if image.mode == "P":
            palette = np.array(image.getpalette("RGB"), dtype=np.uint8)
            return np.asarray(image), _codes(palette.reshape(-1, 3))
        four = (image if image.mode == "RGB" else image.convert("RGB")).tobytes("raw", "RGBX")
        return np.frombuffer(four, dtype="<u4").reshape(image.height, image.width), None
    except (OSError, SyntaxError, ValueError) as error:
        raise MeshError(f"a texture is damaged ({str(error)[:100]})") from error
    finally:
        image.close()


def _sum_changes(labels: Labels) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    """Return the number of texels above and left of each, which differ from the one before them."""
    height, width = labels.shape
    change = np.zeros(labels.shape, dtype=bool)
    change[:, 1:] = labels[:, 1:] != labels[:, :-1]
    change[1:] |= labels[1:] != labels[:-1]
    sums = np.zeros((height + 1, width + 1), dtype=np.int32)
    np.cumsum(change, axis=1, out=sums[1:, 1:])
    for above, row in pairwise(sums):  # a cumsum down the columns takes ten times as long
        row += above
    return sums
