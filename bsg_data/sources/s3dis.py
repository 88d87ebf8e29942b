"""S3DIS and 2D-3D-S: the list of labels of Stanford's scans of campus offices.

`assets/semantic_labels.json` of alexsax/2D-3D-Semantics is a list of instances, each
`category_number_room_number_area`: `chair_1_conferenceRoom_1_3`. It says nothing of places.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import Field, RootModel

from bsg_data.inputs.documents import read_json
from bsg_data.records import Listed
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import once_for_each_state, validate
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    SourceRow,
)
from bsg_data.terms import Terms

_INSTANCE = re.compile(r"^([^_]{1,50})_([0-9]+)_([^_]{1,50})_([0-9]+)_([0-9]+[ab]?)$")
_UNLABELLED = "<UNK>_0_<UNK>_0_0"  # the first of the list, for pixels without a label


_Listing = RootModel[Listed[Annotated[str, Field(pattern=_INSTANCE)]]]
_Area = tuple[tuple[str, str], ...]  # (room, category) of every instance, sorted


@dataclass(frozen=True)
class _S3DISAreas:
    """The list of labels of S3DIS; a scene is an area, a part of a building."""

    path: Path  # semantic_labels.json

    kind = "s3dis"
    options: ClassVar[dict[str, int | str]] = {}

    def find(self) -> FoundScenes:
        """List the areas."""
        areas = sorted(_read_areas(self.path).items())
        refs = [SceneRef(name, name, _digest(content)) for name, content in areas]
        return FoundScenes(tuple(refs))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one area."""
        area = _read_areas(self.path)[ref.scene_id]
        regions = {room: region for region, room in enumerate(sorted({room for room, _ in area}))}
        annotation = Annotation(
            [regions[room] for room, _ in area],
            [name for _, name in area],
            rooms=[
                AnnotatedRoom(region=region, source_label=room.rpartition("_")[0])
                for room, region in regions.items()
            ],
            building_kind="office",
        )
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))


@once_for_each_state
def _read_areas(path: Path) -> Mapping[str, _Area]:
    expected = "a list of category_number_room_number_area, such as chair_1_office_3_1"
    document, code = read_json(path), "listing-malformed"
    areas: dict[str, list[tuple[str, str]]] = {}
    for name in validate(_Listing, document, where=path, expected=expected, code=code).root:
        if name != _UNLABELLED and (match := _INSTANCE.fullmatch(name)):
            areas.setdefault(f"area_{match[5]}", []).append((f"{match[3]}_{match[4]}", match[1]))
    return {area: tuple(sorted(content)) for area, content in areas.items()}


def _digest(area: _Area) -> str:
    return hashlib.sha256(repr(area).encode()).hexdigest()


ROW = SourceRow(
    summary="the list of labels of S3DIS and 2D-3D-S, a JSON file: rooms of campus offices",
    open=_S3DISAreas,
    terms=Terms(
        licence="LicenseRef-2D-3D-S",
        licence_url="http://buildingparser.stanford.edu/dataset.html",
        homepage="https://github.com/alexsax/2D-3D-Semantics",
        citation=(
            "Armeni et al., Joint 2D-3D-Semantic Data for Indoor Scene Understanding, 2017, "
            "arXiv:1702.01105"
        ),
        sentence="What is derived from S3DIS is under Stanford's terms, to be signed for the data.",
    ),
    class_map="s3dis45-v1",
)
