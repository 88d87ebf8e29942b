"""The instance of each texel, vertex or triangle of a mesh, by its exact colour."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.arrays import Bools, Floats, Ints, find_runs
from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.surfaces import BLOCK, Halves, Labels, find_spans, take_corners

UNLISTED, BLACK, FIRST = 0, 1, 2  # two labels that are no instance; that of the first instance
MAX_INSTANCES = 60_000
_TEXELS = 2**17  # of a texture at once, which stay in a cache of the processor
_NOWHERE = 2**24  # the code of a place beyond a palette: no colour, and never listed


class ColourLabels:
    """The label of every colour, and how many texels had which."""

    def __init__(self, colours: Sequence[str | None], snap: int | None) -> None:
        if len(colours) > MAX_INSTANCES:
            raise MeshError(f"{len(colours):,} instances; at most {MAX_INSTANCES:,} are told apart")
        known = {place: int(one, 16) for place, one in enumerate(colours, FIRST) if one is not None}
        self._known = np.array(list(known), dtype=np.uint16)  # labels of instances with a colour
        codes = np.array(list(known.values()), dtype=np.int64)
        self._rgb = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], axis=1)
        self._labels = np.zeros(_NOWHERE + 1, dtype=np.uint16)
        self._labels[0] = BLACK
        self._labels[_codes(self._rgb)] = self._known
        self._unlisted = np.zeros(_NOWHERE + 1, dtype=bool)
        self._snap = snap
        self.texels: Ints = np.zeros(FIRST + len(colours), dtype=np.int64)  # of each label
        self.snapped = 0  # texels of JPEG textures that were near to a listed colour, and not it

    def label(self, image: Image.Image) -> Labels:
        """Return the label of every texel `[H, W]` by its exact colour.

        Neighbours mostly have the same colour: a run of them is looked up once.
        """
        if image.format == "JPEG":
            return self._snap_jpeg(image)
        labels = np.empty((image.height, image.width), dtype=np.uint16)
        step = max(1, _TEXELS // image.width)
        with closing(image):
            shown, palette = _decode(image)
            for top in range(0, image.height, step):
                some = labels[top : top + step]
                starts, values = find_runs(_unpack(shown, top, top + len(some)))
                named = self._look_up(values & 0xFFFFFF if palette is None else palette[values])
                lengths = np.diff(starts, append=some.size)
                self._count(named, lengths)
                some[:] = np.repeat(named, lengths).reshape(some.shape)
        return labels

    def label_vertices(self, colours: npt.NDArray[np.uint8]) -> Labels:
        """Return the label of every vertex `[V]`."""
        return self._look_up(_codes(colours))

    def count_unlisted(self) -> int:
        """Return how many colours were met that no instance has."""
        return int(np.count_nonzero(self._unlisted[:_NOWHERE]))

    def _look_up(self, codes: npt.NDArray[np.integer]) -> Labels:
        labels: Labels = self._labels[codes]
        self._unlisted[codes[labels == UNLISTED]] = True
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
        with closing(image):
            pixels = _unpack(_decode(image)[0], 0, image.height) & 0xFFFFFF
        codes, index, counts = np.unique(pixels, return_inverse=True, return_counts=True)
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
        halves = (np.floor(spots) + np.ceil(spots)).astype(np.int32)  # odd within a texel
        pairs = np.ascontiguousarray(halves.T).view(np.int64)[:, 0]  # one look gives both
        labels, mixed = np.empty(faces.shape[1], np.uint16), np.empty(faces.shape[1], bool)
        for start in range(0, len(labels), BLOCK):
            some = slice(start, start + BLOCK)
            a, b, c = (corner.view(np.int32) for corner in take_corners(pairs, faces[:, some]))
            low, high = find_spans(a, b, c)
            labels[some], mixed[some] = self._look_at(low >> 1, high + 1 >> 1)
        return labels, mixed

    def _look_at(self, low: Halves, high: Halves) -> tuple[Labels, Bools]:
        """Do so for faces from texel `low` to before `high`, `[2F]`: column and row by turns."""
        height, width = self.labels.shape
        np.maximum(high, low + 1, out=high)
        bounds, beyond = [], np.zeros(len(low) // 2, dtype=bool)
        for axis, size in ((1, height), (0, width)):
            first, last = low[axis::2].astype(np.int64), high[axis::2].astype(np.int64)
            turns = first // size * size  # textures repeat
            first -= turns
            last -= turns
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


def _decode(image: Image.Image) -> tuple[Image.Image, npt.NDArray[np.uint32] | None]:
    """Return an image in mode RGB, or in mode P with the codes of its 256 places."""
    if image.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA"):
        raise MeshError(f"a texture has mode {image.mode}; expected 8 bits a channel")
    try:
        image.load()
        if image.mode != "P":
            return (image if image.mode == "RGB" else image.convert("RGB")), None
        palette = _codes(np.array(image.getpalette("RGB"), dtype=np.uint8).reshape(-1, 3))
        return image, np.append(palette, [_NOWHERE] * (256 - len(palette))).astype(np.uint32)
    except (OSError, SyntaxError, ValueError) as error:
        raise MeshError(f"a texture is damaged ({str(error)[:100]})") from error


def _unpack(image: Image.Image, top: int, bottom: int) -> npt.NDArray[np.unsignedinteger]:
    """Return rows of pixels `[P]`: places in a palette, or codes."""
    rows = image.crop((0, top, image.width, bottom))
    if image.mode == "P":
        return np.frombuffer(rows.tobytes(), dtype=np.uint8)
    return np.frombuffer(rows.tobytes("raw", "RGBX"), dtype="<u4")


def _sum_changes(labels: Labels) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    """Return sums of the texels that differ from one before them, above and left of each.

    A sum counts whole rows of its band too, which the differences around an area leave out.
    """
    height, width = labels.shape
    sums = np.empty((height + 1, width + 1), dtype=np.int32)
    sums[0] = 0
    step = max(1, _TEXELS // width)
    for top in range(0, height, step):
        some = labels[top : top + step]
        change = np.zeros((len(some), width + 1), dtype=bool)
        np.not_equal(some[:, 1:], some[:, :-1], out=change[:, 1:-1])
        skip = 1 if top == 0 else 0
        change[skip:, :-1] |= some[skip:] != labels[top + skip - 1 : top + len(some) - 1]
        change[-1, -1] = True  # after all texels
        places = np.flatnonzero(change)
        before = np.repeat(np.arange(len(places), dtype=np.int32), np.diff(places, prepend=-1))
        rows = zip(sums[top:], before.reshape(change.shape), sums[top + 1 :], strict=False)
        for above, row, below in rows:  # a cumsum down the columns takes ten times as long
            np.add(above, row, out=below)
    return sums
