"""Small GLB files for tests, made by trimesh or taken apart and put together again."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.visual.material import PBRMaterial
from trimesh.visual.texture import TextureVisuals

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)  # (column, row from the top)
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def textured(
    pixels: Any, *, size: tuple[float, float] = (1, 1), uv: Any = CORNERS, image: Any = None
) -> trimesh.Trimesh:
    """Return a rectangle in the plane z = 0: row 0 of the pixels `[H, W, 3]` lies at y = 0."""
    picture = image if image is not None else Image.fromarray(np.asarray(pixels, dtype=np.uint8))
    return make_mesh(SQUARE * (*size, 1), FACES, uv, picture)


def make_mesh(points: Any, faces: Any, uv: Any, image: Image.Image) -> trimesh.Trimesh:
    """Return a mesh with a texture; its coordinates are (column, row from the top)."""
    flipped = np.asarray(uv) * [1, -1] + [0, 1]
    visual = TextureVisuals(uv=flipped, material=PBRMaterial(baseColorTexture=image))
    return trimesh.Trimesh(points, faces, visual=visual, process=False)


def write_glb(path: Path, *meshes: trimesh.Trimesh, transform: Any = None) -> Path:
    """Write meshes, all under one transform."""
    scene = trimesh.Scene()
    for mesh in meshes:
        scene.add_geometry(mesh, transform=transform)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(scene.export(file_type="glb"))
    return path


def take_apart(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary chunk of a GLB."""
    (length,) = struct.unpack("<I", data[12:16])
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def put_together(tree: dict[str, Any], binary: bytes) -> bytes:
    """Return the GLB of a JSON and a binary chunk."""
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    return head + chunks + struct.pack("<I4s", len(binary), b"BIN\0") + binary


def edited(path: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    """Change the JSON of a GLB in place."""
    tree, binary = take_apart(path.read_bytes())
    change(tree)
    path.write_bytes(put_together(tree, binary))
    return path


def as_file(image: Image.Image, kind: str, **options: Any) -> Image.Image:
    """Return the image as read from a file of its own, so that it keeps its format."""
    file = io.BytesIO()
    image.save(file, format=kind, **options)
    file.seek(0)
    return Image.open(file)


# A home of two rooms, 4 m and 3.9 m wide, with a door between them, metres, Z up:
# name, region, corner, and the two sides from there.
HOME = (
    ("floor", 0, (0, 0, 0), (4, 0, 0), (0, 3, 0)),
    ("ceiling", 0, (0, 0, 2.6), (4, 0, 0), (0, 3, 0)),
    ("wall", 0, (0, 0, 0), (4, 0, 0), (0, 0, 2.6)),
    ("door", 0, (4, 1, 0), (0, 0.9, 0), (0, 0, 2)),
    ("bed", 0, (0.5, 0.5, 0.6), (2, 0, 0), (0, 1.6, 0)),
    ("floor", 1, (4.1, 0, 0), (3.9, 0, 0), (0, 3, 0)),
    ("ceiling", 1, (4.1, 0, 2.6), (3.9, 0, 0), (0, 3, 0)),
    ("chair", 1, (6, 1, 0.5), (0.5, 0, 0), (0, 0.5, 0)),
)
UP = {"y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "z": np.eye(3)}  # of the file, in axes of the home


def write_homes(root: Path, *, scenes: int) -> None:
    """Write homes as HM3D has them, with meshes beside the annotations: Y up and Z up, in turns."""
    lines = [
        f'{number},{number:X},"{name}",{region}'
        for number, (name, region, *_) in enumerate(HOME, start=1)
    ]
    for scene in range(scenes):
        name = f"example{scene:04d}"
        path = root / f"{scene:05d}-{name}" / f"{name}.semantic.txt"
        turn = np.array(UP["yz"[scene % 2]])
        write_glb(path.with_suffix(".glb"), *_paint_home(turn))
        path.write_text("\n".join(["HM3D Semantic Annotations", *lines, ""]), "utf-8")


def _paint_home(turn: Any) -> Iterator[trimesh.Trimesh]:
    """Yield a rectangle of one colour for each thing of a home."""
    place = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    for number, (_, _, corner, *sides) in enumerate(HOME, start=1):
        image = Image.new("RGB", (1, 1), (0, 0, number))
        points = (np.array(corner) + place @ np.array(sides, dtype=float)) @ turn
        yield make_mesh(points, [[0, 1, 3], [0, 3, 2]], place, as_file(image, "PNG"))
