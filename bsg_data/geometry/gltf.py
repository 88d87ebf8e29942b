"""Read a binary glTF file (GLB) into coloured triangle meshes, through trimesh.

What trimesh would misread without a word is refused with the reason. trimesh reads one mesh per
primitive, because `merge_primitives` would drop the textures.
"""

from __future__ import annotations

import io
import json
import logging
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.arrays import Floats, Ints
from bsg_data.errors import SourceError

_MAGIC = b"glTF"
_FAN, _FLOAT = 6, 5126
_REPEAT, _CLAMP = 10497, 33071
# What changes neither shapes nor colours, though a file may require it; trimesh reads WebP.
_HARMLESS = {
    *("EXT_texture_webp", "KHR_lights_punctual", "KHR_xmp_json_ld"),
    *("KHR_materials_unlit", "KHR_materials_emissive_strength", "KHR_materials_ior"),
    *("KHR_materials_specular", "KHR_materials_clearcoat", "KHR_materials_sheen"),
    *("KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_anisotropy"),
    *("KHR_materials_iridescence", "KHR_materials_dispersion", "KHR_materials_variants"),
}
# What changes them where it is used, required or not.
_MISREAD = {
    *("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"),
    *("EXT_mesh_gpu_instancing", "KHR_mesh_quantization", "KHR_texture_transform"),
    *("KHR_texture_basisu", "KHR_materials_pbrSpecularGlossiness"),
}
_Entry = dict[str, Any]  # of the JSON
# trimesh tells what it does about odd files; we tell the user what we do.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


class MeshError(SourceError):
    """Report a mesh that is unreadable or does not belong to its scene."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Say in an error about a mesh which file it is; turn those of libraries into ours."""
    try:
        yield
    except Exception as error:  # what reads damaged bytes may raise anything
        what, code = f"{type(error).__name__}, {str(error)[:200]}", "mesh-unreadable"
        if isinstance(error, MeshError):
            what, code = str(error), error.code
        message = f"{path}: expected a semantic mesh in a GLB: {what}"
        raise MeshError(message, code=code, where=path) from error


@dataclass(frozen=True, slots=True)
class MeshPart:
    """One primitive as a node shows it; vertices have one row per axis."""

    vertices: npt.NDArray[np.float32]  # [3, V] in the axes and units of the file
    faces: Ints  # [F, 3] indices of vertices
    texture: Image.Image | None  # of its base colour
    places: npt.NDArray[np.complex64] | None  # [V] column + row · i, from 0 to 1, row 0 on top
    colours: npt.NDArray[np.uint8] | None  # [V, 3] of vertices


def read_parts(data: bytes) -> Iterator[MeshPart]:
    """Yield every primitive of a GLB under every node that shows it, those of a texture together.

    Raises:
        MeshError: if it is no GLB, has no triangle, or uses what is not read; other errors are
            those of trimesh, NumPy and Pillow.
    """
    import trimesh  # here, because importing it takes longer than most commands

    tree = _read_tree(data)
    for code, what in _find_unread(tree):
        what += ", which this program does not read; export a plain GLB"
        raise MeshError(what, code=code)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")  # values that are not finite are found below
        file = io.BytesIO(data)
        scene = trimesh.load_scene(file, file_type="glb", merge_primitives=False, process=False)
    shown: dict[int, list[tuple[Any, Floats]]] = {}  # by texture; a part is made when it is due
    for name, mesh in scene.geometry.items():
        # Names of nodes are random where a mesh has several primitives: order by what they say.
        matrices = [scene.graph.get(node)[0] for node in scene.graph.geometry_nodes.get(name, ())]
        for matrix in sorted(matrices, key=lambda matrix: matrix.tolist()):
            if hasattr(mesh, "faces") and len(mesh.faces):  # neither lines nor points
                shown.setdefault(id(_texture_of(mesh)), []).append((mesh, matrix))
    if not shown:
        raise MeshError("shows no triangle", code="mesh-empty")
    clamped = _wraps(tree) == {_CLAMP}
    for mesh, matrix in (placed for meshes in shown.values() for placed in meshes):
        yield _make_part(mesh, matrix, clamped=clamped)


def _read_tree(data: bytes) -> _Entry:
    if data[:4] != _MAGIC:
        what = f"begins with {data[:4]!r}, not with 'glTF'"
        raise MeshError(what, code="mesh-no-glb")
    (length,) = struct.unpack("<I", data[12:16])
    tree: _Entry = json.loads(data[20 : 20 + length])
    return tree


def _find_unread(tree: _Entry) -> Iterator[tuple[str, str]]:
    """Yield what trimesh would misread, each with the code of its error."""
    required = {str(name) for name in tree.get("extensionsRequired", [])}
    odd = required - _HARMLESS | _MISREAD.intersection(tree.get("extensionsUsed", []))
    for name in sorted(odd):
        yield "mesh-extension", f"uses {name}"
    if any("uri" in entry for entry in (*tree.get("buffers", []), *tree.get("images", []))):
        yield "mesh-elsewhere", "its buffer or an image is in another file"
    accessors = tree.get("accessors", [])
    if any("sparse" in entry for entry in accessors):
        yield "mesh-data", "has sparse accessors"
    for primitive in (entry for mesh in tree.get("meshes", []) for entry in mesh["primitives"]):
        place = primitive["attributes"].get("TEXCOORD_0")
        if place is not None and accessors[place]["componentType"] != _FLOAT:
            yield "mesh-data", "has texture coordinates in whole numbers"
        if primitive.get("mode") == _FAN or "targets" in primitive:
            yield "mesh-shape", "has fans of triangles, or morph targets"
    materials = (entry.get("pbrMetallicRoughness", {}) for entry in tree.get("materials", []))
    if any(entry.get("baseColorTexture", {}).get("texCoord", 0) for entry in materials):
        yield "mesh-texture", "has a second set of texture coordinates"
    if _wraps(tree) not in ({_REPEAT}, {_CLAMP}, set()):
        yield "mesh-texture", "its textures repeat in mirrors, or some repeat and some end"


def _wraps(tree: _Entry) -> set[int]:
    """Return how textures go on beyond their edges."""
    textures = tree.get("textures", [])
    used = [tree["samplers"][entry["sampler"]] if "sampler" in entry else {} for entry in textures]
    return {entry.get(side, _REPEAT) for entry in used for side in ("wrapS", "wrapT")}


def _texture_of(mesh: Any) -> Image.Image | None:
    if getattr(mesh.visual, "uv", None) is None:
        return None
    texture: Image.Image | None = getattr(mesh.visual.material, "baseColorTexture", None)
    return texture


def _make_part(mesh: Any, matrix: Floats, *, clamped: bool) -> MeshPart:
    x, y, z = np.array(mesh.vertices.T, dtype=np.float32)
    # Not `@`, whose threads wait for each other longer than the product takes.
    vertices = np.stack([a * x + b * y + c * z + d for a, b, c, d in matrix[:3].tolist()])
    faces = mesh.faces.view(np.ndarray)
    texture, places = _texture_of(mesh), None
    if texture is not None:
        places = np.empty(len(x), dtype=np.complex64)
        places.real, places.imag = mesh.visual.uv[:, 0], 1.0 - mesh.visual.uv[:, 1]
        if clamped:
            edge = np.nextafter(np.float32(1), np.float32(0))
            places = np.clip(places.real, 0, edge) + np.complex64(1j) * np.clip(
                places.imag, 0, edge
            )
        if not np.isfinite(places).all():
            raise MeshError("a texture coordinate is not finite", code="mesh-values")
    return MeshPart(vertices, faces, texture, places, _vertex_colours(mesh))


def _vertex_colours(mesh: Any) -> npt.NDArray[np.uint8] | None:
    if mesh.visual.kind == "vertex":
        given = mesh.visual.vertex_colors
    else:
        given = getattr(mesh.visual, "vertex_attributes", {}).get("color")
    if given is None:
        return None
    colours = np.asarray(given)
    if colours.dtype.kind == "f":
        colours = np.round(np.clip(colours, 0, 1) * 255)
    elif colours.dtype == np.uint16:
        colours = colours // 257
    return colours[:, :3].astype(np.uint8)
