"""Write a furnished building as HM3D's `semantic.glb`, and say what is true of it.

What HM3D's files have, these have: one mesh a room with a primitive for every page of texels, a PNG
texture each (palette or RGB) in which every texel is the colour of an instance, triangles that
straddle instances, colours that nobody listed, and either axis up. glTF is written here and not by
trimesh, whose writer makes one primitive a mesh and chooses the PNG mode itself.
"""

from __future__ import annotations

import io
import struct
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.arrays import Floats
from bsg_data.files import encode_json
from bsg_data.scene.scene_graph import Box
from bsg_data.synthetic.floor_plan import FloorPlan
from painted_meshes.surfaces import Surface

UpAxis = Literal["y", "z"]

Bytes = npt.NDArray[np.uint8]

_PNG_LEVEL = 6
_NEAREST, _FLOAT, _UINT = 9728, 5126, 5125


@dataclass(frozen=True, slots=True)
class _MeshSize:
    """How fine a mesh is."""

    texel: float  # side of a texel, metres
    quad: int  # side of the squares that surfaces are cut into, texels
    page: int  # side of a texture, texels


SIZES = {"small": _MeshSize(0.02, 15, 512), "full": _MeshSize(0.01, 4, 1024)}


_Page = list[tuple[Surface, tuple[int, int]]]  # parts of surfaces, and where each begins


@dataclass(slots=True)
class _Binary:
    """The growing binary chunk of a GLB and the JSON that describes it."""

    data: bytearray = field(default_factory=bytearray)
    views: list[dict[str, int]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)

    def view(self, data: bytes) -> int:
        """Append bytes; return the index of their buffer view."""
        self.data += b"\0" * (-len(self.data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.views) - 1

    def accessor(self, array: npt.NDArray[Any], kind: str, component: int, **more: Any) -> int:
        """Append an array; return the index of its accessor."""
        view = self.view(np.ascontiguousarray(array).tobytes())
        count = array.size if kind == "SCALAR" else len(array)
        entry = {"bufferView": view, "componentType": component, "count": count, "type": kind}
        self.accessors.append({**entry, **more})
        return len(self.accessors) - 1


def encode_mesh(
    surfaces: Sequence[Surface],
    colours: npt.NDArray[np.uint8],
    *,
    size: _MeshSize,
    up_axis: UpAxis,
) -> bytes:
    """Return the bytes of a GLB.

    Args:
        surfaces: of all rooms.
        colours: `[L, 3]`, the colour of every label; row 0 is the background, and the last rows
            are those of the labels below 0, which count from the end.
        size: how fine.
        up_axis: which axis of the file points up.
    """
    binary = _Binary()
    tree: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "painted_meshes"},
        "scene": 0,
        "scenes": [{"nodes": []}],
        "nodes": [],
        "meshes": [],
    }
    materials: dict[str, list[dict[str, Any]]] = {"images": [], "textures": [], "materials": []}
    for room in sorted({surface.room for surface in surfaces}):
        here = [surface for surface in surfaces if surface.room == room]
        tree["scenes"][0]["nodes"].append(len(tree["nodes"]))
        tree["nodes"].append({"mesh": len(tree["meshes"])})
        primitives = []
        for number, tiles in enumerate(_paginate(here, size)):
            primitive = _add_primitive(binary, tiles, up_axis, size)
            image = _paint_page(tiles, size.page)
            primitive["material"] = _add_texture(
                binary, materials, image, colours, palette=(room + number) % 2 == 0
            )
            primitives.append(primitive)
        tree["meshes"].append({"name": f"chunk{room:03d}", "primitives": primitives})
    tree |= {**materials, "samplers": [{"magFilter": _NEAREST, "minFilter": _NEAREST}]}
    return _pack(tree, binary)


def _pack(tree: dict[str, Any], binary: _Binary) -> bytes:
    binary.data += b"\0" * (-len(binary.data) % 4)
    tree["accessors"], tree["bufferViews"] = binary.accessors, binary.views
    tree["buffers"] = [{"byteLength": len(binary.data)}]
    text = encode_json(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary.data))
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text,
        struct.pack("<I4s", len(binary.data), b"BIN\0") + bytes(binary.data),
    )
    return head + b"".join(chunks)


def turn(points: Floats, up_axis: UpAxis) -> Floats:
    """Return points `[..., 3]` of the building, Z up, in the axes of a file."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([x, z, -y] if up_axis == "y" else [x, y, z], axis=-1)


def _paginate(surfaces: list[Surface], size: _MeshSize) -> Iterator[_Page]:
    """Cut surfaces into tiles and set these on shelves, page after page, with a margin of 1."""
    most = size.page // 2 - 2
    tiles = [tile for surface in surfaces for tile in _cut(surface, most, size.texel)]
    tiles.sort(key=lambda tile: -tile.texels.shape[0])
    page: _Page = []
    row = column = height = 0
    for tile in tiles:
        rows, columns = (side + 2 for side in tile.texels.shape)
        if column + columns > size.page:
            row, column, height = row + height, 0, 0
        if row + rows > size.page:
            yield page
            page, row, column, height = [], 0, 0, 0
        page.append((tile, (row + 1, column + 1)))
        column, height = column + columns, max(height, rows)
    yield page


def _cut(surface: Surface, most: int, texel: float) -> Iterator[Surface]:
    rows, columns = surface.texels.shape
    for row in range(0, rows, most):
        for column in range(0, columns, most):
            moved = texel * (column * surface.across + row * surface.upward)
            part = surface.texels[row : row + most, column : column + most]
            yield replace(surface, corner=surface.corner + moved, texels=part)


def _paint_page(tiles: _Page, page: int) -> npt.NDArray[np.int32]:
    """Return the labels of a page `[page, page]`; every tile bleeds one texel into its margin."""
    labels = np.zeros((page, page), dtype=np.int32)
    for tile, (row, column) in tiles:
        rows, columns = tile.texels.shape
        part = labels[row - 1 : row + rows + 1, column - 1 : column + columns + 1]
        part[:] = np.pad(tile.texels, 1, mode="edge")
    return labels


def _add_primitive(
    binary: _Binary,
    tiles: _Page,
    up_axis: UpAxis,
    size: _MeshSize,
) -> dict[str, Any]:
    points, places, faces = [], [], []
    total = 0
    for tile, (top, left) in tiles:
        rows, columns = (_cuts(length, size.quad) for length in tile.texels.shape)
        row, column = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        points.append(
            tile.corner + size.texel * (column[:, None] * tile.across + row[:, None] * tile.upward)
        )
        places.append(np.stack([column + left, row + top], axis=1) / size.page)
        faces.append(_quads(len(rows), len(columns)) + total)
        total += len(row)
    where = turn(np.concatenate(points), up_axis).astype("<f4")
    ends = {"min": where.min(axis=0).tolist(), "max": where.max(axis=0).tolist()}
    attributes = {
        "POSITION": binary.accessor(where, "VEC3", _FLOAT, **ends),
        "TEXCOORD_0": binary.accessor(np.concatenate(places).astype("<f4"), "VEC2", _FLOAT),
    }
    corners = np.concatenate(faces).astype("<u4")
    return {"attributes": attributes, "indices": binary.accessor(corners, "SCALAR", _UINT)}


def _cuts(length: int, quad: int) -> npt.NDArray[np.int64]:
    return np.unique(np.append(np.arange(0, length, quad), length))


def _quads(rows: int, columns: int) -> npt.NDArray[np.int64]:
    """Return the triangles `[F, 3]` of a grid of vertices."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, above, corner = first + 1, first + columns, first + columns + 1
    halves = [np.stack(three, axis=1) for three in ((first, right, corner), (first, corner, above))]
    return np.concatenate(halves)


def _add_texture(
    binary: _Binary,
    materials: dict[str, list[dict[str, Any]]],
    labels: npt.NDArray[np.int32],
    colours: Bytes,
    *,
    palette: bool,
) -> int:
    """Add a page as a PNG, with a palette if it may and can; return its material."""
    places = labels % len(colours)  # labels below 0 count from the end
    used = np.flatnonzero(np.bincount(places.ravel(), minlength=len(colours)))
    if palette and len(used) <= 256:
        rank = np.zeros(len(colours), dtype=np.uint8)
        rank[used] = np.arange(len(used))
        image = Image.fromarray(rank[places], mode="P")
        image.putpalette(colours[used].tobytes())
    else:
        image = Image.fromarray(colours[places])
    file = io.BytesIO()
    image.save(file, format="PNG", compress_level=_PNG_LEVEL)
    materials["images"].append(
        {"bufferView": binary.view(file.getvalue()), "mimeType": "image/png"}
    )
    number = len(materials["textures"])
    materials["textures"].append({"source": number, "sampler": 0})
    shading = {"baseColorTexture": {"index": number}, "metallicFactor": 0}
    materials["materials"].append({"pbrMetallicRoughness": shading, "doubleSided": True})
    return number


def measure_truth(
    surfaces: Sequence[Surface], plan: FloorPlan, *, regions: Sequence[int], texel: float
) -> dict[str, Any]:
    """Return what is true of a building as JSON: boxes, areas and connections, Z up.

    `box` and `centroid` are those of every texel of an instance, `main_box` leaves its specks out.
    """
    boxes: dict[int, list[Box]] = defaultdict(list)
    mains: dict[int, list[Box]] = defaultdict(list)
    moments: dict[int, Floats] = defaultdict(lambda: np.zeros(4))  # texels times place, texels
    for surface in surfaces:
        for label in filter(lambda label: label > 0, np.unique(surface.texels).tolist()):
            chosen = surface.texels == label
            boxes[label].append(surface.box_of(chosen, texel=texel))
            rows, columns = np.nonzero(chosen)
            middle = texel * np.array([columns.mean() + 0.5, rows.mean() + 0.5])
            at = surface.corner + middle[0] * surface.across + middle[1] * surface.upward
            moments[label] = moments[label] + len(rows) * np.array([*at, 1.0])
            main = chosen & ~surface.specks
            if main.any():
                mains[label].append(surface.box_of(main, texel=texel))
    return {
        "instances": {
            str(label): {
                "texels": int(moments[label][3]),
                "area": round(float(moments[label][3]) * texel**2, 6),
                "centroid": [round(float(v), 6) for v in moments[label][:3] / moments[label][3]],
                "box": _join(boxes[label]),
                "main_box": _join(mains[label]),
            }
            for label in sorted(boxes)
        },
        "connections": [[regions[a], regions[b], kind] for a, b, kind in plan.connections()],
    }


def _join(boxes: list[Box]) -> list[list[float]] | None:
    """Return the box around boxes as [lowest corner, highest corner]."""
    if not boxes:
        return None
    low = np.min([box.minimum for box in boxes], axis=0)
    high = np.max([box.maximum for box in boxes], axis=0)
    return [[round(float(value), 6) for value in corner] for corner in (low, high)]
