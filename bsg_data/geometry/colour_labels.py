"""The instance of each texel or vertex of a mesh, by its exact colour."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.arrays import Ints, find_runs
from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.surfaces import Labels, Values

Pixels = npt.NDArray[np.unsignedinteger]

UNLISTED, BLACK, FIRST = 0, 1, 2  # two labels that are no instance; that of the first instance
_MOST_LABELS = 2**16
_NOWHERE = 2**24  # the code of a place beyond a palette: no colour, and never listed
_MODES = ("1", "L", "LA", "P", "PA", "RGB", "RGBA")


@dataclass(frozen=True, slots=True)
class LabelSheet:
    """The labels of a texture."""

    pixels: Pixels  # [H, W]
    values: Pixels  # [N] of these pixels, ascending
    labels: Labels  # [N] of each value

    def label(self, places: Values) -> Labels:
        """Return the label of the texel at every place `[P]`: column + row · i, from 0 to 1."""
        height, width = self.pixels.shape
        column, row = places.real - np.floor(places.real), places.imag - np.floor(places.imag)
        texel = (row * height).astype(np.int64) * width + (column * width).astype(np.int64)
        shown = self.pixels.take(texel, mode="clip")
        labels: Labels = self.labels.take(np.searchsorted(self.values, shown))
        return labels


class ColourLabels:
    """The label of every colour, and how many texels had which."""

    def __init__(self, colours: Sequence[str | None], snap: int | None) -> None:
        if len(colours) > _MOST_LABELS - FIRST:
            raise MeshError(f"{len(colours):,} instances; at most 65,534 are told apart")
        known = {0: BLACK}
        for label, colour in enumerate(colours, FIRST):
            if colour is not None:
                known[int.from_bytes(int(colour, 16).to_bytes(3, "big"), "little")] = label
        self._codes = np.array(sorted(known), dtype=np.uint32)
        self._labels = np.array([known[code] for code in sorted(known)], dtype=np.uint16)
        self._unlisted: set[int] = set()
        self._snap = snap
        self.texels: Ints = np.zeros(FIRST + len(colours), dtype=np.int64)  # of each label
        self.snapped = 0  # texels of JPEG textures that were near to a listed colour, and not it

    def read(self, image: Image.Image) -> LabelSheet:
        """Return the labels of a texture, whose texels are counted."""
        is_jpeg = image.format == "JPEG"
        if is_jpeg and self._snap is None:
            raise MeshError(
                "a texture is JPEG, which changes colours, so that texels no longer say "
                "which instance they are; --option snap_colours=N takes the nearest listed colour "
                "within N"
            )
        with closing(image):
            pixels, palette = _unpack(image)
        starts, runs = find_runs(pixels.ravel())
        values, place = np.unique(runs, return_inverse=True)
        counts = np.bincount(place, np.diff(starts, append=pixels.size)).astype(np.int64)
        codes = values & np.uint32(0xFFFFFF) if palette is None else palette[values]
        labels = self._snap_near(codes, counts) if is_jpeg else self.look_up(codes)
        self._unlisted.update(codes[labels == UNLISTED].tolist())
        np.add.at(self.texels, labels, counts)
        return LabelSheet(pixels, values, labels)

    def label_vertices(self, colours: npt.NDArray[np.uint8]) -> Labels:
        """Return the label of every vertex `[V]`."""
        codes = _encode(colours)
        labels = self.look_up(codes)
        self._unlisted.update(np.unique(codes[labels == UNLISTED]).tolist())
        return labels

    def count_unlisted(self) -> int:
        """Return how many colours were met that no instance has."""
        return len(self._unlisted - {_NOWHERE})

    def look_up(self, codes: Pixels) -> Labels:
        """Return the label of every colour `[N]`."""
        place = np.searchsorted(self._codes, codes)
        is_known = self._codes.take(place, mode="clip") == codes
        return np.where(is_known, self._labels.take(place, mode="clip"), np.uint16(UNLISTED))

    def _snap_near(self, codes: Pixels, counts: Ints) -> Labels:
        """Return the label of the nearest instance's colour to every code `[N]`."""
        from scipy.spatial import cKDTree  # slow to import, and JPEG is rare

        exact, is_listed = self.look_up(codes), self._labels >= FIRST
        tree, within = cKDTree(_decode(self._codes[is_listed])), (self._snap or 0) + 0.5
        distance, nearest = tree.query(_decode(codes), p=np.inf, distance_upper_bound=within)
        is_near = np.isfinite(distance)
        listed = np.append(self._labels[is_listed], np.uint16(UNLISTED))  # near to none: the last
        self.snapped += int(counts[is_near & (exact < FIRST)].sum())
        return np.where(is_near, listed[nearest], exact)


def _encode(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint32]:
    """Return colours `[N, 3]` as whole numbers, red lowest: the order of bytes in memory."""
    red, green, blue = rgb.astype(np.uint32).T
    return np.asarray(red | green << 8 | blue << 16)


def _decode(codes: Pixels) -> Ints:
    """Return the channels of colours `[N, 3]`."""
    return np.stack([codes & 255, codes >> 8 & 255, codes >> 16], axis=1).astype(np.int64)


def _unpack(image: Image.Image) -> tuple[Pixels, Pixels | None]:
    """Return the pixels `[H, W]` of an image, and the code at each place of its palette."""
    if image.mode not in _MODES:
        raise MeshError(f"a texture has mode {image.mode}; expected 8 bits a channel")
    size = image.height, image.width
    if image.mode == "P":
        pixels = np.frombuffer(image.tobytes(), dtype=np.uint8).reshape(size)
        palette = _encode(np.array(image.getpalette("RGB"), dtype=np.uint8).reshape(-1, 3))
        return pixels, np.append(palette, [_NOWHERE] * (256 - len(palette))).astype(np.uint32)
    shown = image if image.mode == "RGB" else image.convert("RGB")
    return np.frombuffer(shown.tobytes("raw", "RGBX"), dtype="<u4").reshape(size), None
