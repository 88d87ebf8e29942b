"""Read a binary glTF file (GLB) into coloured triangle meshes, through trimesh.

The header is checked first. A file that is cut off, points outside itself or asks for far more than
a building needs is refused, with the reason, before it is unpacked. So is a file that trimesh would
misread silently. trimesh, NumPy and json refuse other faults themselves. trimesh reads one mesh per
primitive, because `merge_primitives` would drop the textures.
"""

from __future__ import annotations

import io
import logging
import os
import struct
import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.errors import SourceError
from bsg_data.inputs.documents import parse_json

Floats = npt.NDArray[np.float64]

# The largest real file is near 100 MB; these bound what a hostile one can make us hold.
MAX_FILE = 512 * 2**20
MAX_JSON = 32 * 2**20
MAX_FACES = 10_000_000
MAX_VERTICES = 20_000_000
MAX_TEXTURE = 8192
MAX_TEXELS = 2**30
MAX_NODES = 20_000
MAX_DEPTH = 64
MAX_REPEATS = 1e5  # of a texture
_MAGIC, _BIN = b"glTF", b"BIN\0"
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_REPEAT, _CLAMP = 10497, 33071
# What an attribute must be: its types, and the types of its numbers (signed ones and unsigned).
_FLOAT, _COUNTS, _SHADES = {5126}, {5121, 5123, 5125}, {5121, 5123, 5126}
_KINDS = {
    "POSITION": ({"VEC3"}, _FLOAT),
    "TEXCOORD_0": ({"VEC2"}, _FLOAT),
    "COLOR_0": ({"VEC3", "VEC4"}, _SHADES),
    "indices": ({"SCALAR"}, _COUNTS),
}
# trimesh tells what it does about odd files; we tell the user what we do.
logging.getLogger("trimesh").addHandler(logging.NullHandler())
_SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu")


class MeshError(SourceError):
    """Report a mesh that is unreadable or does not belong to its scene."""


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
    """Yield every primitive of a GLB under every node that shows it, those of a texture together.

    Raises:
        MeshError: naming what is wrong with the file.
    """
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # values that are not finite are found below
            scene, clamped = _load(path)
        yield from _parts(scene, path, clamped=clamped)
    except OSError as error:
        raise MeshError(f"{path}: cannot be read ({error.strerror or error})") from error
    except MeshError:
        raise
    except Exception as error:  # a reader of hostile bytes may raise anything
        what = f"{type(error).__name__}: {str(error)[:200]}"
        raise MeshError(f"{path}: not readable as glTF ({what})") from error


def _load(path: Path) -> tuple[Any, bool]:
    """Return the scene of a file that was checked, and whether its textures end at their edges."""
    import trimesh  # here, because importing it takes longer than most commands

    with path.open("rb") as file:
        tree = _read_header(file, path)
        _check_tree(tree, file, path)
        clamped = _check_samplers(tree, path)
        file.seek(0)
        scene = trimesh.load_scene(file, file_type="glb", merge_primitives=False, process=False)
    return scene, clamped


def _parts(scene: Any, path: Path, *, clamped: bool) -> Iterator[MeshPart]:
    graph = scene.graph
    shown: dict[int, list[tuple[Any, Floats]]] = {}  # by texture; a part is made when it is due
    for name, mesh in scene.geometry.items():
        if not hasattr(mesh, "faces"):  # lines or points
            continue
        # Names of nodes are random where a mesh has several primitives: order by what they say.
        matrices = [graph.get(node)[0] for node in graph.geometry_nodes.get(name, ())]
        for matrix in sorted(matrices, key=lambda matrix: matrix.tolist()):
            shown.setdefault(id(_texture_of(mesh)), []).append((mesh, matrix))
    for meshes in shown.values():
        for mesh, matrix in meshes:
            yield _part(mesh, matrix, path, clamped=clamped)


def _texture_of(mesh: Any) -> Image.Image | None:
    if getattr(mesh.visual, "uv", None) is None:
        return None
    texture: Image.Image | None = getattr(mesh.visual.material, "baseColorTexture", None)
    return texture


def _part(mesh: Any, matrix: Floats, path: Path, *, clamped: bool) -> MeshPart:
    with np.errstate(all="ignore"):
        vertices = mesh.vertices.view(np.ndarray) @ matrix[:3, :3].T + matrix[:3, 3]
    faces = mesh.faces.view(np.ndarray)
    if not np.isfinite(vertices).all():
        raise MeshError(f"{path}: a vertex is not finite")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise MeshError(f"{path}: a face has a vertex that is not there")
    texture, places = _texture_of(mesh), None
    if texture is not None:
        places = np.asarray(mesh.visual.uv, dtype=np.float64)
        if places.shape != (len(vertices), 2) or not (np.abs(places) < MAX_REPEATS).all():
            raise MeshError(f"{path}: texture coordinates that are not one sane pair a vertex")
        places = np.stack([places[:, 0], 1.0 - places[:, 1]], axis=1)  # trimesh counts from below
        if clamped:
            places = np.clip(places, 0.0, np.nextafter(1.0, 0.0))
    return MeshPart(vertices, faces, texture, places, _vertex_colours(mesh, path))


def _vertex_colours(mesh: Any, path: Path) -> npt.NDArray[np.uint8] | None:
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
        raise MeshError(f"{path}: vertex colours that are not one colour a vertex")
    return colours[:, :3].astype(np.uint8)


def _read_header(file: IO[bytes], path: Path) -> dict[str, Any]:
    """Return the JSON of a GLB, whose chunks fit its size."""
    size = os.fstat(file.fileno()).st_size
    if size > MAX_FILE:
        raise MeshError(f"{path}: {size:,} bytes, more than {MAX_FILE:,}: not one building's mesh")
    if not size:
        raise MeshError(f"{path}: is empty")
    head = file.read(20)
    if len(head) < 20 or head[:4] != _MAGIC:
        raise MeshError(f"{path}: expected a GLB, which begins with 'glTF', found {head[:4]!r}")
    _, length, text_length = struct.unpack("<III", head[4:16])
    if length != size:
        what = "is cut off" if length > size else "goes on after its end"
        raise MeshError(f"{path}: {what}: it says {length:,} bytes and has {size:,}")
    if text_length > min(size - 20, MAX_JSON):
        raise MeshError(f"{path}: its JSON says {text_length:,} bytes, which cannot be")
    tree: dict[str, Any] = parse_json(file.read(text_length), once=False)
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
    sizes = _check_accessors(tree, path)
    counts = [
        _check_primitives(mesh, number, tree, sizes, path)
        for number, mesh in enumerate(tree.get("meshes", []))
    ]
    if not sum(faces for faces, _ in counts):
        raise MeshError(f"{path}: holds no triangle")
    _check_load(counts, "holds", path)
    _check_nodes(tree, counts, path)
    _check_images(tree, file, path)


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
    mesh: dict[str, Any], number: int, tree: dict[str, Any], sizes: list[int], path: Path
) -> tuple[int, int]:
    """Return the number of triangles and of vertices of a mesh."""
    faces = vertices = 0
    for primitive in mesh["primitives"]:
        if _COMPRESSED[0] in primitive.get("extensions", {}):
            raise MeshError(f"{path}: is compressed by {_COMPRESSED[0]}, which is not read")
        used = dict(primitive["attributes"])
        if "indices" in primitive:
            used["indices"] = primitive["indices"]
        count = sizes[_index(used["POSITION"], sizes)]
        for name, accessor in used.items():
            _check_kind(name, tree["accessors"][_index(accessor, sizes)], number, path)
        if "material" in primitive:
            _index(primitive["material"], tree.get("materials", []))
        corners = sizes[used["indices"]] if "indices" in used else count
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _FAN:
            raise MeshError(f"{path}: mesh {number} is a triangle fan, which is not read")
        faces += {_TRIANGLES: corners // 3, _STRIP: max(0, corners - 2)}.get(mode, 0)
        vertices += count
    return faces, vertices


def _check_kind(name: str, accessor: dict[str, Any], number: int, path: Path) -> None:
    types, numbers = _KINDS.get(name, (set(_WIDTHS), set(_SIZES)))
    if accessor["type"] not in types or accessor["componentType"] not in numbers:
        raise MeshError(
            f"{path}: mesh {number} has {name} as {accessor['type']} of component type "
            f"{accessor['componentType']}; expected {' or '.join(sorted(types))} of "
            f"{' or '.join(str(kind) for kind in sorted(numbers))}"
        )


def _check_load(counts: Iterable[tuple[int, int]], does: str, path: Path) -> None:
    faces, vertices = (sum(column) for column in zip(*counts, strict=True))
    if faces > MAX_FACES or vertices > MAX_VERTICES:
        raise MeshError(
            f"{path}: {does} {faces:,} triangles and {vertices:,} vertices; at most {MAX_FACES:,} "
            f"and {MAX_VERTICES:,} are read"
        )


def _check_nodes(tree: dict[str, Any], counts: list[tuple[int, int]], path: Path) -> None:
    """Walk the nodes from the scene: each is reached once, and all it shows is not too much."""
    nodes, scenes = tree.get("nodes", []), tree.get("scenes", [])
    roots = scenes[_index(tree.get("scene", 0), scenes)].get("nodes", [])
    waiting = [(root, 1) for root in roots]
    reached, shown = 0, [(0, 0)]
    while waiting:
        number, depth = waiting.pop()
        node = nodes[_index(number, nodes)]
        waiting += [(child, depth + 1) for child in node.get("children", [])]
        reached += 1
        shown += [counts[_index(node["mesh"], counts)]] if "mesh" in node else []
        if reached > min(len(nodes), MAX_NODES) or depth > MAX_DEPTH:
            raise MeshError(
                f"{path}: its nodes run in a circle, share children, or are too many (at most "
                f"{MAX_NODES:,}, {MAX_DEPTH} deep)"
            )
    if not sum(faces for faces, _ in shown):
        raise MeshError(f"{path}: no node of its scene shows a triangle")
    _check_load(shown, "shows", path)


def _check_samplers(tree: dict[str, Any], path: Path) -> bool:
    """Return whether textures end at their edges instead of repeating.

    Raises:
        MeshError: for a way to look textures up that this program does not have.
    """
    wraps = {
        sampler.get(side, _REPEAT)
        for sampler in tree.get("samplers", [])
        for side in ("wrapS", "wrapT")
    }
    if not wraps <= {_REPEAT} and not wraps <= {_CLAMP}:
        raise MeshError(f"{path}: its textures repeat in mirrors, or some repeat and some end")
    for number, material in enumerate(tree.get("materials", [])):
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture") or {}
        if texture.get("texCoord", 0) != 0 or "KHR_texture_transform" in texture.get(
            "extensions", {}
        ):
            raise MeshError(f"{path}: material {number} moves its texture, or has a second one")
    return wraps == {_CLAMP}


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
        return Image.open(io.BytesIO(data), formats=("PNG", "JPEG")).size
    except OSError as error:  # its text has an address in memory: no build would repeat it
        raise MeshError(f"{what} is no readable PNG ({type(error).__name__})") from error


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
