"""Read HM3D's annotation text `<hash>.semantic.txt`.

The first line contains `HM3D Semantic Annotations`; every other is `id,HEXRGB,"name",region`.
Quirks of the real files: names hold commas, slashes, odd case and non-ASCII letters; colours lack
their leading zeros; region ids of 0 and more are rooms, negative ones are the null region; ids may
be out of order; a blank or `unknown` name is an object without a class.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import AnnotationError
from bsg_data.inputs.bounds import ANNOTATION
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.annotation_files import decode, read_listed

HEADER = "HM3D Semantic Annotations"
_ROW = re.compile(r'([0-9]{1,9}),([0-9A-Fa-f]{1,6}),"(.*)",(-?[0-9]{1,9})')
_EXPECTED = 'id,HEXRGB,"name",region (for example 12,0F3A9C,"chair",4)'


@dataclass(frozen=True, slots=True)
class Instance:
    """One annotated instance as its source gives it.

    Attributes:
        instance_id: unique in its scene.
        name: the free text, exactly as annotated.
        region_id: its region; negative is the null region.
        colour: RRGGBB, upper case, six digits; None where the source has none.
        centroid: where the source says that it is, metres, Z up; None where it does not.
        box: its axis-aligned box, metres, Z up; None where the source has none.
    """

    instance_id: int
    name: str
    region_id: int
    colour: str | None = None
    centroid: Point | None = None
    box: Box | None = None


@dataclass(frozen=True, slots=True)
class Annotation:
    """The annotation of one scene.

    Attributes:
        instances: sorted by instance id.
        sha256: hash of the bytes that it was read from.
    """

    instances: tuple[Instance, ...]
    sha256: str


def read_annotation(path: Path, *, expected: str | None = None) -> Annotation:
    """Read one `semantic.txt`.

    Args:
        path: of the file.
        expected: its fingerprint when it was listed; None if it was not.

    Raises:
        SourceError: if the file cannot be read or is far too large.
        SourceChangedError: if it is not what it was when it was listed.
        AnnotationError: naming the first line that is malformed.
    """
    data = read_listed(path, ANNOTATION, expected=expected)
    return Annotation(parse_annotation(data, path=path), hashlib.sha256(data).hexdigest())


def parse_annotation(data: bytes, *, path: Path) -> tuple[Instance, ...]:
    """Parse the bytes of one `semantic.txt` into instances sorted by id.

    Args:
        data: the file's content.
        path: named in errors.

    Raises:
        AnnotationError: for the first malformed line, wrong encoding, a repeated id or colour, or
            a file without instances.
    """
    lines = decode(data, path=path).split("\n")  # not splitlines(): a name may hold a U+2028
    if HEADER not in lines[0]:
        raise AnnotationError(path, 1, lines[0], expected=repr(HEADER))
    instances: dict[int, Instance] = {}
    colours: set[str] = set()
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        instance = _parse_row(line, path, number)
        if instance.instance_id in instances:
            raise AnnotationError(path, number, line, expected="an id that no earlier line has")
        if instance.colour in colours:
            raise AnnotationError(path, number, line, expected="a colour that no earlier line has")
        instances[instance.instance_id] = instance
        colours.add(str(instance.colour))
    if not instances:
        raise AnnotationError(path, None, "", expected="at least one annotated instance")
    return tuple(instances[key] for key in sorted(instances))


def _parse_row(line: str, path: Path, number: int) -> Instance:
    match = _ROW.fullmatch(line.rstrip())
    if match is None:
        raise AnnotationError(path, number, line, expected=_EXPECTED)
    instance_id, colour, name, region = match.groups()
    return Instance(int(instance_id), name, int(region), colour.upper().zfill(6))
