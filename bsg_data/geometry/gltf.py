"""Read a binary glTF file (GLB) into coloured triangle meshes, through trimesh.

A file that is too large, or that trimesh would misread silently, is refused with the reason.
trimesh, NumPy and Pillow refuse other faults themselves. trimesh reads one mesh per primitive,
because `merge_primitives` would drop the textures.
"""

from __future__ import annotations

import json
import logging
import os
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.arrays import Floats, Ints
from bsg_data.errors import SourceError

# The largest real file is near 100 MB.
MAX_FILE = 512 * 2**20
MAX_JSON = 32 * 2**20
MAX_FACES = 10_000_000
MAX_REPEATS = 1e5  # of a texture
_MAGIC = b"glTF"
_FAN = 6
_REPEAT, _CLAMP = 10497, 33071
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu")
# trimesh tells what it does about odd files; we tell the user what we do.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


class MeshError(SourceError):
    """Report a mesh that is unreadable or does not belong to its scene."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Say in an error about a mesh which file it is, unless it says so already."""
    try:
        yield
    except MeshError as error:
        if error.where:
            raise
        raise MeshError(f"{path}: {error}", code=error.code, where=path) from error


@dataclass(frozen=True, slots=True)
class MeshPart:
    """One primitive as a node shows it."""

    vertices: Floats  # [V, 3] in the axes and units of the file
    faces: Ints  # [F, 3] indices of vertices
    texture: Image.Image | None  # of its base colour
    places: Floats | None  # [V, 2] column and row on the texture, from 0 to 1, row 0 on top
    colours: npt.NDArray[np.uint8] | None  # [V, 3] of vertices


def read_parts(path: Path) -> Iterator[MeshPart]:
    """Yield every primitive of a GLB under every node that shows it, those of a texture together.

    Raises:
        MeshError: naming what is wrong with the file.
    """
    with naming(path):
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")  # values that are not finite are found below
                scene, clamped = _load(path)
            yield from _parts(scene, clamped=clamped)
        except MeshError:
            raise
        except Exception as error:  # a reader of hostile bytes may raise anything
            what = f"{type(error).__name__}: {str(error)[:200]}"
            raise MeshError(f"not readable as glTF ({what})", code="mesh-unreadable") from error


def _load(path: Path) -> tuple[Any, bool]:
    """Return the scene of a file that was checked, and whether its textures end at their edges."""
    import trimesh  # here, because importing it takes longer than most commands

    with path.open("rb") as file:
        tree = _read_tree(file)
        _refuse_what_is_misread(tree)
        file.seek(0)
        scene = trimesh.load_scene(file, file_type="glb", merge_primitives=False, process=False)
    return scene, _are_clamped(tree)


def _read_tree(file: IO[bytes]) -> dict[str, Any]:
    """Return the JSON of a GLB that is not larger than a building's mesh can be."""
    size = os.fstat(file.fileno()).st_size
    if size > MAX_FILE:
        raise MeshError(f"{size:,} bytes; at most {MAX_FILE:,} are read", code="mesh-too-large")
    head = file.read(20)
    if len(head) < 20 or head[:4] != _MAGIC:
        what = f"expected a GLB, which begins with 'glTF', found {head[:4]!r}"
        raise MeshError(what, code="mesh-no-glb")
    (length,) = struct.unpack("<I", head[12:16])
    tree: dict[str, Any] = json.loads(file.read(min(length, MAX_JSON)))
    return tree


def _refuse_what_is_misread(tree: dict[str, Any]) -> None:
    """Refuse what trimesh does not read, or misreads, and more triangles than a building has."""
    used = {str(name) for name in tree.get("extensionsRequired", [])} & set(_COMPRESSED)
    if used:
        what = f"is compressed by {min(used)}, which this program does not read"
        raise MeshError(what, code="mesh-compressed")
    if any("uri" in one for one in (*tree.get("buffers", []), *tree.get("images", []))):
        raise MeshError("its buffer or an image is not in the file", code="mesh-elsewhere")
    primitives = [one for mesh in tree.get("meshes", []) for one in mesh["primitives"]]
    if any(one.get("mode") == _FAN for one in primitives):
        what = "holds a triangle fan, which this program does not read"
        raise MeshError(what, code="mesh-fan")
    listed = [one.get("indices", one["attributes"]["POSITION"]) for one in primitives]
    faces = sum(tree["accessors"][number]["count"] for number in listed) // 3
    if faces > MAX_FACES:
        what = f"{faces:,} triangles; at most {MAX_FACES:,} are read"
        raise MeshError(what, code="mesh-too-large")
    for number, material in enumerate(tree.get("materials", [])):
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture") or {}
        moved = "KHR_texture_transform" in texture.get("extensions", {})
        if moved or texture.get("texCoord", 0) != 0:
            what = f"material {number} moves its texture, or has a second one"
            raise MeshError(what, code="mesh-texture")


def _are_clamped(tree: dict[str, Any]) -> bool:
    """Return whether textures end at their edges, and do not repeat; refuse other ways."""
    wraps = {
        sampler.get(side, _REPEAT)
        for sampler in tree.get("samplers", [])
        for side in ("wrapS", "wrapT")
    }
    if not wraps <= {_REPEAT} and not wraps <= {_CLAMP}:
        what = "its textures repeat in mirrors, or some repeat and some end"
        raise MeshError(what, code="mesh-texture")
    return wraps == {_CLAMP}


def _parts(scene: Any, *, clamped: bool) -> Iterator[MeshPart]:
    graph = scene.graph
    shown: dict[int, list[tuple[Any, Floats]]] = {}  # by texture; a part is made when it is due
    for name, mesh in scene.geometry.items():
        if not hasattr(mesh, "faces"):  # lines or points
            continue
        # Names of nodes are random where a mesh has several primitives: order by what they say.
        matrices = [graph.get(node)[0] for node in graph.geometry_nodes.get(name, ())]
        for matrix in sorted(matrices, key=lambda matrix: matrix.tolist()):
            shown.setdefault(id(_texture_of(mesh)), []).append((mesh, matrix))
    if not sum(len(mesh.faces) for meshes in shown.values() for mesh, _ in meshes):
        raise MeshError("shows no triangle", code="mesh-empty")
    for meshes in shown.values():
        for mesh, matrix in meshes:
            yield _part(mesh, matrix, clamped=clamped)


def _texture_of(mesh: Any) -> Image.Image | None:
    if getattr(mesh.visual, "uv", None) is None:
        return None
    texture: Image.Image | None = getattr(mesh.visual.material, "baseColorTexture", None)
    return texture


def _part(mesh: Any, matrix: Floats, *, clamped: bool) -> MeshPart:
    with np.errstate(all="ignore"):
        vertices = mesh.vertices.view(np.ndarray) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = mesh.faces.view(np.ndarray)
    if not np.isfinite(vertices).all():
        raise MeshError("a vertex is not finite", code="mesh-values")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise MeshError("a face has a vertex that is not there", code="mesh-values")
    texture, places = _texture_of(mesh), None
    if texture is not None:
        places = np.asarray(mesh.visual.uv, dtype=np.float64)
        if places.shape != (len(vertices), 2) or not (np.abs(places) < MAX_REPEATS).all():
            what = "texture coordinates that are not one sane pair a vertex"
            raise MeshError(what, code="mesh-values")
        places = np.stack([places[:, 0], 1.0 - places[:, 1]], axis=1)  # trimesh counts from below
        if clamped:
            places = np.clip(places, 0.0, np.nextafter(1.0, 0.0))
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
    if colours.ndim != 2 or colours.shape[1] < 3 or len(colours) != len(mesh.vertices):
        raise MeshError("vertex colours that are not one colour a vertex", code="mesh-values")
    return colours[:, :3].astype(np.uint8)
