"""Meshes in binary glTF: `bsg_data.geometry.gltf`."""

from __future__ import annotations

import base64
import binascii
import io
import json
import struct
from pathlib import Path

from bsg_data.geometry.gltf import read_parts
from fuzz.target import NoFileError, Target, encode, parse, put

_MOST_BINARY = 4_096


def _make(*, image: bool) -> bytes:
    import numpy as np
    import trimesh
    from PIL import Image
    from trimesh.visual.material import PBRMaterial
    from trimesh.visual.texture import TextureVisuals

    corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    if image:
        pixels = Image.fromarray(np.full((2, 2, 3), 7, dtype=np.uint8))
        visual = TextureVisuals(corners[:, :2], PBRMaterial(baseColorTexture=pixels))
        mesh = trimesh.Trimesh(corners, faces, visual=visual, process=False)
    else:
        colours = np.full((4, 4), 255, dtype=np.uint8)
        mesh = trimesh.Trimesh(corners, faces, vertex_colors=colours, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="node", geom_name="mesh")
    made: bytes = scene.export(file_type="glb")
    return made


def _take_apart(data: bytes) -> bytes:
    (length,) = struct.unpack("<I", data[12:16])
    binary = base64.b64encode(data[28 + length :]).decode()
    return encode({"tree": json.loads(data[20 : 20 + length]), "binary": binary})


def _put_together(data: bytes) -> bytes:
    document = parse(data)
    try:
        binary = base64.b64decode(str(document.get("binary", "")).encode(), validate=False)
        text = json.dumps(document.get("tree")).encode("utf-8", "surrogatepass")
    except (binascii.Error, ValueError) as error:
        raise NoFileError(str(error)) from error
    text += b" " * (-len(text) % 4)
    binary = binary[:_MOST_BINARY]
    file = io.BytesIO()
    file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary)))
    file.write(struct.pack("<I4s", len(text), b"JSON") + text)
    file.write(struct.pack("<I4s", len(binary), b"BIN\0") + binary)
    return file.getvalue()


def seeds() -> dict[str, bytes]:
    """Return a square with a texture, and one with coloured corners, whole and taken apart."""
    whole = {"texture": _make(image=True), "colours": _make(image=False)}
    return {**whole, **{f"{name}.json": _take_apart(data) for name, data in whole.items()}}


def read(folder: Path, data: bytes) -> object:
    """Read a GLB, or what its JSON and its binary chunk make, with lengths that are right."""
    glb = _put_together(data) if data[:1] == b"{" else data
    return list(read_parts(put(folder, ".glb", glb)))


TARGET = Target(
    name="mesh",
    read=read,
    seeds=seeds,
    words=(
        *("KHR_draco_mesh_compression", "sparse", "uri", "byteStride", "matrix", "rotation"),
        *("KHR_texture_transform", "children", "extras", "skins", "MAT4", "COLOR_0", "5125", "BIN"),
    ),
    most=3_500,
)
