"""Read HM3D's folders: annotation texts `<hash>.semantic.txt`, and the meshes beside them.

The first line of a text contains `HM3D Semantic Annotations`; every other is
`id,HEXRGB,"name",region`. Quirks of the real files: names hold commas, slashes, odd case and
non-ASCII letters; colours lack their leading zeros; region ids of 0 and more are rooms, negative
ones are the null region; ids may be out of order; a blank or `unknown` name is an object without a
class.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import AnnotationError, SourceError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.geometry.adjacency import connect_rooms
from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.placement import place_scene
from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import (
    SPLITS,
    fingerprint,
    keep_one_copy,
    list_files,
    malformed,
    read_scene_file,
    require_lasting,
    show_line,
)
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import Annotation, FoundScenes, Reading, SceneRef, SourceRow
from bsg_data.terms import Terms

_HOMEPAGE = "https://aihabitat.org/datasets/hm3d-semantics/"
_CITATION = "Yadav et al., Habitat-Matterport 3D Semantics Dataset, CVPR 2023, arXiv:2210.05633"
MATTERPORT = Terms(
    licence="LicenseRef-matterport-academic",
    licence_url=(
        "https://matterport.com/matterport-end-user-license-agreement-academic-use-model-data"
    ),
    homepage=_HOMEPAGE,
    citation=_CITATION,
    sentence=(
        "What is derived from Habitat-Matterport 3D stays under Matterport's terms of use for "
        "academic research."
    ),
)
_SUFFIXES = (".semantic.txt", "_semantic.txt")
SYNTHETIC_MARK = "synthetic.json"
HEADER = "HM3D Semantic Annotations"
_ROW = re.compile(  # id, colour or what stands there instead, name, region
    r'([0-9]{1,9}),(?:([0-9A-Fa-f]{1,6})|([^,"]*)),"(.*)",(-?[0-9]{1,9})\s*'
)
_NO_TEXT = re.compile("[\udc80-\udcff]")  # a surrogate stands for a byte that is no UTF-8
_EXPECTED = 'id,HEXRGB,"name",region (for example 12,0F3A9C,"chair",4)'
_VERSION = re.compile(r"v([0-9]+\.[0-9]+)|^hm3d[-_]([0-9]+\.[0-9]+)$")
_OF_HM3D = re.compile(r"hm3d.*|v[0-9]+\.[0-9]+", re.IGNORECASE)  # not every v1.0 above a root
# Six and seven digits are of our own synthetic buildings, which have a hash as HM3D's have;
# 240101-office is a name.
_NUMBERED = re.compile(r"([0-9]{5}|[0-9]{6,7}(?=-[A-Za-z0-9]{11}$))-(.+)")
# HM3D's own numbers: 0-799 train, 800-899 val, 900-999 test.
_FIRST_OF_NEXT = {800: "train", 900: "val", 1000: "test"}


class HM3DFolder:
    """A folder with HM3D's annotation texts at any depth below it.

    `bsg-data synth` writes a `synthetic.json` above its buildings, so they are never read as real
    ones.

    Attributes:
        path: the folder.
        meshes: whether to read the mesh beside an annotation, if there is one.
        snap_colours: largest distance per channel between a texel of a JPEG texture and an
            instance's colour; None leaves out meshes with such textures.
        kind: `synthetic` for buildings of `bsg-data synth`, otherwise `hm3d`.
    """

    def __init__(self, path: AnyPath, meshes: bool = True, snap_colours: int | None = None) -> None:
        self.path, self.meshes, self.snap_colours = Path(path), meshes, snap_colours
        self.kind = "synthetic" if _is_synthetic(self.path) else "hm3d"

    @property
    def options(self) -> dict[str, int | str]:
        """The options about meshes."""
        snap = {} if self.snap_colours is None else {"snap_colours": self.snap_colours}
        return {"meshes": int(self.meshes), **snap}

    def find(self) -> FoundScenes:
        """Find every `*.semantic.txt` and `*_semantic.txt` below the folder."""
        if not self.path.is_dir():
            zipped = (
                "; the statistics are read with --source hm3d-stats" if self.path.is_file() else ""
            )
            what = f"expected a folder, found {'a file' if self.path.is_file() else 'none'}"
            message = f"{self.path}: {what}{zipped}"
            raise SourceError(message, code="source-missing", where=self.path)
        expected = (
            "no scene found; looked in every folder below it for <hash>.semantic.txt or "
            "<hash>_semantic.txt, as in hm3d/train/00006-HkseAnWCgqk/HkseAnWCgqk.semantic.txt. The "
            "annotations come in HM3D's `semantic-annots` archives, which are downloaded beside "
            "the meshes"
        )
        listed, unreadable = list_files(self.path, (*_SUFFIXES, SYNTHETIC_MARK), expected=expected)
        for mark in (file for file in listed if file.name == SYNTHETIC_MARK):
            if self.kind != "synthetic":
                raise SourceError(
                    f"{self.path}: holds synthetic buildings in {mark.parent}; point --hm3d at "
                    "either these or the real buildings",
                    code="source-mixed",
                    where=mark.parent,
                )
        root = self.path.resolve().name
        found = keep_one_copy(
            [self._refer(file, root) for file in listed if file.name.endswith(_SUFFIXES)],
            path=self.path,
            expected=expected,
            digest=lambda ref: hash_file(self.path / ref.location),
        )
        return replace(found, unreadable=unreadable)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its annotation text, and its geometry from the mesh beside that."""
        path, data = read_scene_file(self.path, ref)
        annotation, faults = parse_annotation(data, path=path)
        left_out = tuple(SkippedScene(ref.scene_id, ref.location, why) for why in faults)
        graph = assemble(annotation, ref=ref, kind=self.kind, class_map=class_map)
        mesh = self._find_mesh(path)
        if mesh is None:
            return Reading(graph, left_out=left_out)
        try:
            if not mesh.is_file():
                raise MeshError(f"{mesh}: not a file, or a link that leads nowhere")
            colours = [obj.colour for obj in graph.objects]
            survey = survey_mesh(mesh, colours, snap_colours=self.snap_colours)
        except MeshError as error:
            require_lasting(error, mesh)
            where = mesh.relative_to(self.path).as_posix()
            skip = SkippedScene(scene_id=ref.scene_id, location=where, reason=str(error))
            return Reading(graph, left_out=(*left_out, skip))
        placed = connect_rooms(place_scene(graph, survey))
        return Reading(placed, survey.coverage, left_out=left_out)

    def _find_mesh(self, annotation: Path) -> Path | None:
        mesh = annotation.with_suffix(".glb")
        return mesh if self.meshes and (mesh.exists() or mesh.is_symlink()) else None

    def _refer(self, path: Path, root: str) -> SceneRef:
        relative = path.relative_to(self.path)
        suffix = next(suffix for suffix in _SUFFIXES if path.name.endswith(suffix))
        building = path.name.removesuffix(suffix)
        parent = path.parent.resolve().name
        scene_id = parent if split_scene_id(parent)[1] == building else building
        folders, mesh = (root, *relative.parts[:-1]), self._find_mesh(path)
        return SceneRef(
            scene_id=scene_id,
            location=relative.as_posix(),
            fingerprint=fingerprint(path),
            source_split=_last(map(_split_of_folder, folders)) or split_by_number(scene_id),
            source_version=_last(map(version_of, (root, *_names_above(path), *folders[1:]))),
            geometry=None if mesh is None else fingerprint(mesh),
            building=split_scene_id(building)[1],
        )


def _is_synthetic(path: Path) -> bool:
    """Say whether a folder, or one of the two above it, has the mark of synthetic buildings."""
    above = (path, *resolve_links(path).parents[:2])
    return any((folder / SYNTHETIC_MARK).is_file() for folder in above)


def parse_annotation(data: bytes, *, path: Path) -> tuple[Annotation, tuple[str, ...]]:
    """Parse the bytes of one `semantic.txt`.

    A line that is malformed, or has the id of an earlier one, is left out. An object whose colour
    no mesh can have, or an earlier one has, is kept without a colour.

    Returns:
        The annotation; what is wrong with lines.

    Raises:
        AnnotationError: if the first line is none of HM3D's, or no line is well-formed.
    """
    first, _, below = data.decode("utf-8-sig", "surrogateescape").partition("\n")
    if HEADER not in first:
        raise malformed(path, 1, first, expected=repr(HEADER))
    rows, faults = _read_rows(below)
    if not rows and faults:
        raise AnnotationError(f"{path}, {faults[0]}", code="line-malformed", where=path)
    if not rows:
        raise malformed(path, 1, first, expected="at least one annotated instance below")
    colours, names, regions = zip(*rows.values(), strict=True)
    sha256 = hashlib.sha256(data).hexdigest()
    return Annotation(regions, names, ids=[*rows], colours=colours, sha256=sha256), tuple(faults)


def _read_rows(below: str) -> tuple[dict[int, tuple[str | None, str, int]], list[str]]:
    """Return id → colour, name and region of well-formed lines, and what is wrong with lines."""
    rows: dict[int, tuple[str | None, str, int]] = {}
    faults: list[str] = []
    colours = {""}
    for number, line in enumerate(below.split("\n"), start=2):  # a name may hold a U+2028
        match, expected = _ROW.fullmatch(line), _EXPECTED
        if match and _NO_TEXT.search(line):
            match, expected = None, "UTF-8 text"
        elif match and int(match[1]) in rows:
            match, expected = None, "an id of no earlier line"
        if match is None:
            if line.strip():
                faults.append(f"line {number}: expected {expected}, found {show_line(line)}")
            continue
        digits, digit_colour, other, name, region = match.groups(default="")
        colour = digit_colour.upper().zfill(6) if digit_colour else ""
        if colour in colours:
            why = "expected a colour HEXRGB of no earlier line"
            shown = (digit_colour or other)[:20]
            faults.append(f"line {number}: {why}, found {shown!r}: kept without a colour")
        rows[int(digits)] = (None if colour in colours else colour, name, int(region))
        colours.add(colour)
    return rows, faults


def split_scene_id(scene_id: str) -> tuple[int | None, str]:
    """Split a scene id into its number, None without one, and the building's own hash.

    >>> split_scene_id("00006-HkseAnWCgqk"), split_scene_id("HkseAnWCgqk")
    ((6, 'HkseAnWCgqk'), (None, 'HkseAnWCgqk'))
    >>> split_scene_id("240101-office")
    (None, '240101-office')
    """
    match = _NUMBERED.fullmatch(scene_id)
    return (int(match[1]), match[2]) if match else (None, scene_id)


def _split_of_folder(folder: str) -> str | None:
    """Read the split from a folder's name: `train`, or `hm3d-minival-semantic-annots-v0.2`.

    >>> _split_of_folder("hm3d-minival-semantic-annots-v0.2")
    'minival'
    """
    name = folder.split("-")[1] if folder.startswith("hm3d-") else folder
    return name if name in SPLITS else None


def split_by_number(scene_id: str) -> str | None:
    """Read the split from the number of a scene; None without one.

    >>> split_by_number("00801-HaxA7YrQdEC")
    'val'
    """
    number, _ = split_scene_id(scene_id)
    ends = _FIRST_OF_NEXT.items()
    return None if number is None else next((split for end, split in ends if number < end), None)


def version_of(name: str) -> str | None:
    """Read the version from the name of a folder or file.

    >>> version_of("HM3DSem-v0.2.zip"), version_of("hm3d-0.2")
    ('v0.2', 'v0.2')
    """
    match = _VERSION.search(name)
    return f"v{match[1] or match[2]}" if match else None


def _names_above(file: Path) -> tuple[str, ...]:
    """Return HM3D's own names of folders above a file: as they are said, then behind links."""
    ways = (file.absolute(), file.parent.resolve(), file.resolve())
    return tuple(name for way in ways for name in way.parent.parts if _OF_HM3D.fullmatch(name))


def _last(values: Iterator[str | None]) -> str | None:
    """Return the last value that is not None: that of the folder nearest to the file."""
    return next((value for value in reversed(list(values)) if value is not None), None)


ROW = SourceRow(
    summary="a folder above HM3D's annotations, v0.1 or v0.2, with or without the meshes",
    open=HM3DFolder,
    terms=MATTERPORT,
)


def _open_synthetic(
    path: Path, *, meshes: bool = True, snap_colours: int | None = None
) -> HM3DFolder:
    """Open a folder of synthetic buildings."""
    folder = HM3DFolder(path, meshes=meshes, snap_colours=snap_colours)
    if path.is_dir() and folder.kind != "synthetic":
        raise SourceError(
            f"{path}: holds no buildings of `bsg-data synth`; read it as the source hm3d",
            code="source-mixed",
            where=path,
        )
    return folder


SYNTHETIC_ROW = SourceRow(
    summary="a folder that `bsg-data synth` wrote",
    open=_open_synthetic,
    terms=Terms(
        licence="Apache-2.0",
        licence_url="https://www.apache.org/licenses/LICENSE-2.0",
        homepage=_HOMEPAGE,
        citation="Saucedo et al., Belief Scene Graphs, ICRA 2024, arXiv:2402.03840",
        sentence="The buildings are synthetic: no building like them exists, and none was scanned.",
    ),
)
