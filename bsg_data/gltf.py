"""Read a binary glTF file (GLB) into coloured triangle meshes, through trimesh.

The header is checked first: a file that is cut off, points outside itself or asks for far more than
a building needs is refused with the reason before anything of it is unpacked. trimesh then reads
it with one mesh a primitive: `merge_primitives` would drop the textures.
"""

from __future__ import annotations

import io
import json
import os
import struct
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.errors import SourceError

Floats = npt.NDArray[np.float64]

# The largest real file is near 100 MB; these bound what a hostile one can make us hold.
MAX_FILE = 512 * 2**20
MAX_JSON = 32 * 2**20
MAX_FACES = 10_000_000
MAX_VERTICES = 20_000_000
MAX_TEXTURE = 8192
MAX_TEXELS = 2**30
MAX_NODES = 200_000
_MAGIC, _JSON, _BIN = b"glTF", b"JSON", b"BIN\0"
_SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu")


class MeshError(SourceError):
    """Report a mesh that cannot be read or does not belong to its scene."""


@dataclass(frozen=True, slots=True)
class MeshPart:
    """One primitive as a node shows it.

    Attributes:
        vertices: `[V, 3]` in the axes and units of the file.
        faces: `[F, 3]` indices of vertices.
        texture: the image of its base colour; None without one.
        places: `[V, 2]` column and row on the texture, from 0 to 1, row 0 on top; None likewise.
        colours: `[V, 3]` vertex colours; None without them.
    """

    vertices: Floats
    faces: npt.NDArray[np.int64]
    texture: Image.Image | None
    places: Floats | None
    colours: npt.NDArray[np.uint8] | None


def read_parts(path: Path) -> Iterator[MeshPart]:
    """Yield every primitive of a GLB under every node that shows it, in the order of the file.

    Raises:
        MeshError: naming what is wrong with the file, before the first part.
    """
    import trimesh  # here, because importing it takes longer than most commands

    try:
        with path.open("rb") as file:
            tree = _read_header(file, path)
            _check_tree(tree, file, path)
            file.seek(0)
            scene = trimesh.load_scene(file, file_type="glb", merge_primitives=False, process=False)
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror or error})") from error
    except MeshError:
        raise
    except Exception as error:  # a reader of hostile bytes may raise anything
        what = str(error) or type(error).__name__
        raise MeshError(f"{path}: not readable as glTF ({what[:200]})") from error
    yield from _parts(scene, path)


def _parts(scene: Any, path: Path) -> Iterator[MeshPart]:
    graph = scene.graph
    for name, mesh in scene.geometry.items():
        if not hasattr(mesh, "faces"):  # lines or points
            continue
        # Names of nodes are random where a mesh has several primitives: order by what they say.
        matrices = [graph.get(node)[0] for node in graph.geometry_nodes.get(name, ())]
        for matrix in sorted(matrices, key=lambda matrix: matrix.tolist()):
            yield _part(mesh, matrix, path)


def _part(mesh: Any, matrix: Floats, path: Path) -> MeshPart:
    vertices = mesh.vertices.view(np.ndarray) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = mesh.faces.view(np.ndarray)
    if not np.isfinite(vertices).all():
        raise MeshError(f"{path}: a vertex is not finite")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise MeshError(f"{path}: a face has a vertex that is not there")
    texture = getattr(getattr(mesh.visual, "material", None), "baseColorTexture", None)
    places = getattr(mesh.visual, "uv", None) if texture is not None else None
    if places is not None:
        if len(places) != len(vertices) or not np.isfinite(places).all():
            raise MeshError(f"{path}: texture coordinates that are not one finite pair a vertex")
        places = np.stack([places[:, 0], 1.0 - places[:, 1]], axis=1)  # trimesh counts from below
    return MeshPart(
        vertices=vertices,
        faces=faces,
        texture=texture if places is not None else None,
        places=places,
        colours=_vertex_colours(mesh, path),
    )


def _vertex_colours(mesh: Any, path: Path) -> npt.NDArray[np.uint8] | None:
    if mesh.visual.kind == "vertex":
        found = mesh.visual.vertex_colors
    else:
        found = getattr(mesh.visual, "vertex_attributes", {}).get("color")
    if found is None:
        return None
    colours = np.asarray(found)
    if colours.dtype.kind == "f":
        colours = np.round(np.clip(colours, 0, 1) * 255)
    elif colours.dtype == np.uint16:
        colours = colours // 257
    if colours.ndim != 2 or colours.shape[1] < 3 or len(colours) != len(mesh.vertices):
        raise MeshError(f"{path}: vertex colours that are not one colour a vertex")
    return colours[:, :3].astype(np.uint8)


def _read_header(file: IO[bytes], path: Path) -> dict[str, Any]:
    """Return the JSON of a GLB, whose chunks fit its size."""
    size = os.fstat(file.fileno()).st_size
    if size > MAX_FILE:
        raise MeshError(f"{path}: {size:,} bytes, more than {MAX_FILE:,}: not one building's mesh")
    head = file.read(20)
    if len(head) < 20 or head[:4] != _MAGIC:
        raise MeshError(f"{path}: expected a GLB, which begins with 'glTF', found {head[:4]!r}")
    version, length, text_length = struct.unpack("<III", head[4:16])
    if version != 2 or head[16:20] != _JSON:
        raise MeshError(f"{path}: expected glTF 2 with a JSON chunk first, found version {version}")
    if length != size:
        what = "is cut off" if length > size else "goes on after its end"
        raise MeshError(f"{path}: {what}: it says {length:,} bytes and has {size:,}")
    if text_length > min(size - 20, MAX_JSON):
        raise MeshError(f"{path}: its JSON says {text_length:,} bytes, which cannot be")
    try:
        tree = json.loads(file.read(text_length))
    except (ValueError, RecursionError) as error:
        raise MeshError(f"{path}: its JSON is damaged ({str(error)[:100]})") from error
    if not isinstance(tree, dict):
        raise MeshError(f"{path}: its JSON is no object")
    rest = file.read(8)
    binary, kind = struct.unpack("<I4s", rest) if len(rest) == 8 else (0, _BIN)
    if kind != _BIN or binary > size - file.tell():
        raise MeshError(f"{path}: its binary chunk is cut off")
    buffers = tree.get("buffers", [])
    inside = len(buffers) == 1 and "uri" not in buffers[0]
    if buffers and not (inside and _count(buffers[0], "byteLength") <= binary):
        raise MeshError(f"{path}: its buffer is not in the file, or longer than its binary chunk")
    return tree


def _check_tree(tree: dict[str, Any], file: IO[bytes], path: Path) -> None:
    """Refuse what points outside the file or asks for too much.

    Raises:
        MeshError: saying what.
    """
    used = {str(name) for name in tree.get("extensionsRequired", [])} & set(_COMPRESSED)
    if used:
        raise MeshError(f"{path}: is compressed by {min(used)}, which this program does not read")
    try:
        sizes = _check_accessors(tree, path)
        faces = [_check_primitives(mesh, tree, sizes, path) for mesh in tree.get("meshes", [])]
        if not sum(faces):
            raise MeshError(f"{path}: holds no triangle")
        _check_nodes(tree, faces, path)
        _check_images(tree, file, path)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise MeshError(f"{path}: its JSON is no glTF ({type(error).__name__}: {error})") from error


def _check_accessors(tree: dict[str, Any], path: Path) -> list[int]:
    """Return the number of items of every accessor."""
    whole = _count(tree["buffers"][0], "byteLength")
    views = tree["bufferViews"]
    total = 0
    for number, view in enumerate(views):
        start, length = _count(view, "byteOffset", 0), _count(view, "byteLength")
        total += length
        if view["buffer"] != 0 or start + length > whole or total > 2 * whole:
            raise MeshError(f"{path}: bufferView {number} ends beyond the buffer ({whole:,} bytes)")
    total, sizes = 0, []
    for number, accessor in enumerate(tree["accessors"]):
        if "bufferView" not in accessor or "sparse" in accessor:
            raise MeshError(
                f"{path}: accessor {number} is sparse, which this program does not read"
            )
        view, count = views[_index(accessor["bufferView"], views)], _count(accessor, "count")
        item = _SIZES[accessor["componentType"]] * _WIDTHS[accessor["type"]]
        stride = _count(view, "byteStride", item) or item
        need = _count(accessor, "byteOffset", 0) + max(0, count - 1) * stride + item * (count > 0)
        if need > view["byteLength"]:
            raise MeshError(
                f"{path}: accessor {number} counts {count:,} items, {need:,} bytes, and its "
                f"bufferView has {view['byteLength']:,}"
            )
        total += count * item
        sizes.append(count)
    if total > 4 * whole:
        raise MeshError(f"{path}: its accessors unpack the same bytes again and again")
    return sizes


def _check_primitives(
    mesh: dict[str, Any], tree: dict[str, Any], sizes: list[int], path: Path
) -> int:
    """Return the number of triangles of a mesh."""
    faces = vertices = 0
    for primitive in mesh["primitives"]:
        attributes = primitive["attributes"]
        for accessor in (
            *attributes.values(),
            *([primitive["indices"]] * ("indices" in primitive)),
        ):
            _index(accessor, sizes)
        if "material" in primitive:
            _index(primitive["material"], tree.get("materials", []))
        count = sizes[attributes["POSITION"]]
        corners = sizes[primitive["indices"]] if "indices" in primitive else count
        faces += corners // 3 if primitive.get("mode", 4) == 4 else corners
        vertices += count
    if faces > MAX_FACES or vertices > MAX_VERTICES:
        raise MeshError(f"{path}: a mesh of {faces:,} triangles; at most {MAX_FACES:,} are read")
    return faces


def _check_nodes(tree: dict[str, Any], faces: list[int], path: Path) -> None:
    """Walk the nodes from the scene: each is reached once, and all it shows is not too much."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    roots = scenes[_index(tree.get("scene", 0), scenes)].get("nodes", [])
    waiting, reached, shown = list(roots), 0, 0
    while waiting:
        node = nodes[_index(waiting.pop(), nodes)]
        waiting += node.get("children", [])
        reached += 1
        shown += faces[_index(node["mesh"], faces)] if "mesh" in node else 0
        if reached > min(len(nodes), MAX_NODES):
            raise MeshError(f"{path}: its nodes run in a circle, share children, or are too many")
        if shown > MAX_FACES:
            raise MeshError(f"{path}: shows {shown:,} triangles; at most {MAX_FACES:,} are read")
    if not shown:
        raise MeshError(f"{path}: no node of its scene shows a triangle")


def _check_images(tree: dict[str, Any], file: IO[bytes], path: Path) -> None:
    """Open every image, without unpacking it, and see that it is there and of a size to unpack."""
    start, texels = file.tell(), 0
    for number, image in enumerate(tree.get("images", [])):
        if "bufferView" not in image:
            raise MeshError(f"{path}: image {number} is not in the file")
        view = tree["bufferViews"][_index(image["bufferView"], tree["bufferViews"])]
        file.seek(start + view.get("byteOffset", 0))
        width, height = _image_size(file.read(view["byteLength"]), f"{path}: image {number}")
        texels += width * height
        if max(width, height) > MAX_TEXTURE or texels > MAX_TEXELS:
            raise MeshError(
                f"{path}: image {number} has {width:,} × {height:,} texels; at most "
                f"{MAX_TEXTURE:,} a side are read, and {MAX_TEXELS:,} in all"
            )
    for number, texture in enumerate(tree.get("textures", [])):
        if "source" not in texture:
            raise MeshError(f"{path}: texture {number} has no image")
        _index(texture["source"], tree.get("images", []))
    for material in tree.get("materials", []):
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if texture is not None:
            _index(texture["index"], tree.get("textures", []))


def _image_size(data: bytes, what: str) -> tuple[int, int]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our limit is lower
            return Image.open(io.BytesIO(data), formats=("PNG", "JPEG")).size
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise MeshError(f"{what} is no readable PNG ({str(error)[:100]})") from error


def _count(entry: dict[str, Any], key: str, default: int | None = None) -> int:
    """Return a whole number of 0 or more."""
    value = entry.get(key, default) if default is not None else entry[key]
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ValueError(f"{key} is {value!r}")
    return value


def _index(value: Any, things: Sequence[Any]) -> int:
    """Return an index that is there; a negative one is not."""
    if not isinstance(value, int) or not 0 <= value < len(things):
        raise IndexError(f"index {value!r} of {len(things)}")
    return value
