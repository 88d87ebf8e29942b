"""Read a binary glTF file (GLB) into coloured triangle meshes, through trimesh.

A file that is too large, or that trimesh would misread silently, is refused with the reason: what
is not known to be read right counts as misread. trimesh, NumPy and Pillow refuse other faults
themselves. trimesh reads one mesh per primitive, because `merge_primitives` would drop the
textures.
"""

from __future__ import annotations

import io
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
MAX_FACES = 10_000_000  # as often as nodes show them
MAX_VERTICES = 3 * MAX_FACES
MAX_NODES = 20_000  # trimesh takes 0.7 ms and 50 kB for each
MAX_DEPTH = 64  # of nodes below nodes; trimesh's time grows with its square
MAX_SIDE = 8_192  # texels; a file of 0.5 MB may unpack to 13,000 × 13,000, which take 2 GB
MAX_TEXELS = 2**30  # of all textures
MAX_REPEATS = 1e5  # of a texture
_MAGIC = b"glTF"
_TRIANGLES, _STRIP = 4, 5
_MODES = range(6)  # all but fans
_REPEAT, _CLAMP = 10497, 33071
_FORMATS = ("PNG", "JPEG", "WEBP")
_WEBP = "EXT_texture_webp"
# What a file may require: trimesh reads it, or it changes neither shapes nor colours of surfaces.
_KNOWN = {
    *(_WEBP, "KHR_texture_transform", "KHR_lights_punctual", "KHR_xmp_json_ld"),
    *("KHR_materials_unlit", "KHR_materials_emissive_strength", "KHR_materials_ior"),
    *("KHR_materials_specular", "KHR_materials_clearcoat", "KHR_materials_sheen"),
    *("KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_anisotropy"),
    *("KHR_materials_iridescence", "KHR_materials_dispersion", "KHR_materials_variants"),
}
# What changes them where it stands, required or not.
_MISREAD = {
    *("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"),
    *("EXT_mesh_gpu_instancing", "KHR_materials_pbrSpecularGlossiness"),
}
_NUMBERS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
# The types and numbers that trimesh takes for what they mean; it does not scale whole numbers.
_KINDS = {
    "POSITION": (("VEC3",), ("f4",)),
    "TEXCOORD_0": (("VEC2",), ("f4",)),
    "COLOR_0": (("VEC3", "VEC4"), ("u1", "u2", "f4")),
    "indices": (("SCALAR",), ("u1", "u2", "u4")),
}
_Entry = dict[str, Any]  # of the JSON
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
    """One primitive as a node shows it; one row per axis or corner, as in surfaces."""

    vertices: Floats  # [3, V] in the axes and units of the file
    faces: Ints  # [3, F] indices of vertices
    texture: Image.Image | None  # of its base colour
    places: Floats | None  # [2, V] column and row on the texture, from 0 to 1, row 0 on top
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
        clamped = _check_textures(tree, file)
        file.seek(0)
        scene = trimesh.load_scene(file, file_type="glb", merge_primitives=False, process=False)
    return scene, clamped


def _read_tree(file: IO[bytes]) -> _Entry:
    """Return the JSON of a GLB that is not larger than a building's mesh can be."""
    size = os.fstat(file.fileno()).st_size
    if size > MAX_FILE:
        raise MeshError(f"{size:,} bytes; at most {MAX_FILE:,} are read", code="mesh-too-large")
    head = file.read(20)
    if len(head) < 20 or head[:4] != _MAGIC:
        what = f"expected a GLB, which begins with 'glTF', found {head[:4]!r}"
        raise MeshError(what, code="mesh-no-glb")
    (length,) = struct.unpack("<I", head[12:16])
    tree: _Entry = json.loads(file.read(min(length, MAX_JSON)))
    return tree


def _refuse_what_is_misread(tree: _Entry) -> None:
    """Refuse what trimesh does not read, or misreads, and more than a building has."""
    meshes, nodes = tree.get("meshes", []), tree.get("nodes", [])
    views, materials = tree.get("bufferViews", []), tree.get("materials", [])
    primitives = [one for mesh in meshes for one in mesh["primitives"]]
    used = {name for one in (*primitives, *views, *nodes, *materials) for name in _extend(one)}
    odd = used & _MISREAD | {str(name) for name in tree.get("extensionsRequired", [])} - _KNOWN
    if odd:
        what = f"uses {min(odd)}, which this program does not read; export it without"
        raise MeshError(what, code="mesh-extension")
    if any("uri" in one for one in (*tree.get("buffers", []), *tree.get("images", []))):
        raise MeshError("its buffer or an image is not in the file", code="mesh-elsewhere")
    for number, accessor in enumerate(tree.get("accessors", [])):
        if "sparse" in accessor or "bufferView" not in accessor:
            what = f"accessor {number} is sparse or empty, which this program does not read"
            raise MeshError(what, code="mesh-data")
    sizes = [_measure(mesh, number, tree["accessors"]) for number, mesh in enumerate(meshes)]
    shown = [sizes[node["mesh"]] for node in _walk(tree) if "mesh" in node]
    for load in (sizes, shown):
        faces, vertices = sum(one for one, _ in load), sum(one for _, one in load)
        if faces > MAX_FACES or vertices > MAX_VERTICES:
            what = (
                f"{faces:,} triangles and {vertices:,} vertices; at most {MAX_FACES:,} and "
                f"{MAX_VERTICES:,} are read"
            )
            raise MeshError(what, code="mesh-too-large")


def _extend(entry: _Entry) -> _Entry:
    """Return the extensions of an entry by name."""
    extensions: _Entry = entry.get("extensions", {})
    return extensions


def _measure(mesh: _Entry, number: int, accessors: list[_Entry]) -> tuple[int, int]:
    """Return how many triangles and vertices a mesh has; refuse one of a kind that is misread."""
    faces = vertices = 0
    for primitive in mesh["primitives"]:
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in _MODES or "targets" in primitive:
            what = "has morph targets" if mode in _MODES else f"is drawn in mode {mode}"
            raise MeshError(
                f"mesh {number} {what}, which this program does not read", code="mesh-shape"
            )
        held = {**primitive["attributes"], "indices": primitive.get("indices")}
        for name, (types, numbers) in _KINDS.items():
            if held.get(name) is None:
                continue
            accessor = accessors[held[name]]
            found = accessor["type"], _NUMBERS[accessor["componentType"]]
            if found[0] not in types or found[1] not in numbers:
                what = (
                    f"mesh {number}: expected {name} as {' or '.join(types)} of "
                    f"{' or '.join(numbers)}, found {' of '.join(found)}; export it unquantised"
                )
                raise MeshError(what, code="mesh-data")
        count = accessors[held["POSITION"]]["count"]
        corners = count if held["indices"] is None else accessors[held["indices"]]["count"]
        faces += {_TRIANGLES: corners // 3, _STRIP: corners}.get(mode, 0)
        vertices += count
    return faces, vertices


def _walk(tree: _Entry) -> Iterator[_Entry]:
    """Yield the nodes of the scene; refuse those that trimesh would lose or take too long for."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    roots = scenes[tree.get("scene", 0)].get("nodes", []) if scenes else []
    waiting = [(root, 1) for root in roots]
    met: set[int] = set()
    while waiting:
        number, depth = waiting.pop()
        node = nodes[number]
        if number in met or len(met) == MAX_NODES or depth > MAX_DEPTH:
            what = (
                f"node {number} is below two nodes"
                if number in met
                else f"has more than {MAX_NODES:,} nodes, or more than {MAX_DEPTH} in one line"
            )
            raise MeshError(f"{what}, which this program does not read", code="mesh-nodes")
        if "skin" in node or ("camera" in node and node.keys() & {"mesh", "children"}):
            what = "moves its mesh by a skin" if "skin" in node else "is a camera and more"
            raise MeshError(
                f"node {number} {what}, which this program does not read", code="mesh-nodes"
            )
        met.add(number)
        waiting += [(child, depth + 1) for child in node.get("children", [])]
        yield node


def _check_textures(tree: _Entry, file: IO[bytes]) -> bool:
    """Return whether textures end at their edges, and do not repeat; refuse what is misread.

    The file stands at the end of its JSON.
    """
    start = file.tell() + 8
    wraps: set[int] = set()
    images: dict[int | None, int] = {}  # texels
    for number, material in enumerate(tree.get("materials", [])):
        given = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if not given:
            continue
        if "KHR_texture_transform" in _extend(given) or given.get("texCoord", 0) != 0:
            what = f"material {number} moves its texture, or has a second one"
            raise MeshError(what, code="mesh-texture")
        texture = tree["textures"][given["index"]]
        sampler = tree["samplers"][texture["sampler"]] if "sampler" in texture else {}
        wraps |= {sampler.get(side, _REPEAT) for side in ("wrapS", "wrapT")}
        image = _extend(texture).get(_WEBP, {}).get("source", texture.get("source"))
        if image not in images:
            images[image] = _count_texels(tree, image, file, start)
        if not images[image]:
            what = (
                f"the texture of material {number} is no readable PNG, JPEG or WebP image in the "
                f"file, of at most {MAX_SIDE:,} texels a side"
            )
            raise MeshError(what, code="mesh-texture")
    if sum(images.values()) > MAX_TEXELS:
        what = f"{sum(images.values()):,} texels; at most {MAX_TEXELS:,} are read"
        raise MeshError(what, code="mesh-too-large")
    if not wraps <= {_REPEAT} and not wraps <= {_CLAMP}:
        what = "its textures repeat in mirrors, or some repeat and some end"
        raise MeshError(what, code="mesh-texture")
    return wraps == {_CLAMP}


def _count_texels(tree: _Entry, image: int | None, file: IO[bytes], start: int) -> int:
    """Return the texels of an image, of which only the head is read; 0 if it is not to be used."""
    if image is None or tree["images"][image].get("mimeType") == "image/ktx2":
        return 0
    view = tree["bufferViews"][tree["images"][image]["bufferView"]]
    file.seek(start + view.get("byteOffset", 0))
    try:
        with Image.open(io.BytesIO(file.read(view["byteLength"])), formats=_FORMATS) as opened:
            width, height = opened.size
    except (OSError, Image.DecompressionBombError):
        return 0
    return width * height if max(width, height) <= MAX_SIDE else 0


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
        x, y, z = mesh.vertices.view(np.ndarray).T
        # Not `@`, whose threads wait for each other longer than the product takes.
        vertices = np.stack([a * x + b * y + c * z + d for a, b, c, d in matrix[:3]])
    faces = np.ascontiguousarray(mesh.faces.view(np.ndarray).T, dtype=np.int64)
    if not np.isfinite(vertices).all():
        raise MeshError("a vertex is not finite", code="mesh-values")
    if faces.size and faces.view(np.uint64).max() >= vertices.shape[1]:  # below 0 is huge
        raise MeshError("a face has a vertex that is not there", code="mesh-values")
    texture, places = _texture_of(mesh), None
    if texture is not None:
        places = np.array(np.transpose(mesh.visual.uv), dtype=np.float64, order="C")
        if places.shape != (2, vertices.shape[1]) or not (np.abs(places) < MAX_REPEATS).all():
            what = "texture coordinates that are not one sane pair a vertex"
            raise MeshError(what, code="mesh-values")
        places[1] = 1.0 - places[1]  # trimesh counts from below
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
