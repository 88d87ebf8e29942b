"""Read HM3D's annotation text `<hash>.semantic.txt`.

The first line contains `HM3D Semantic Annotations`; every other is `id,HEXRGB,"name",region`.
Quirks of the real files: names hold commas, slashes, odd case and non-ASCII letters; colours lack
their leading zeros; region ids of 0 and more are rooms, negative ones are the null region; ids may
be out of order; a blank or `unknown` name is an object without a class.
"""

from __future__ import annotations

import re
from pathlib import Path

from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.annotation_files import decode, malformed

HEADER = "HM3D Semantic Annotations"
_ROW = re.compile(r'([0-9]{1,9}),([0-9A-Fa-f]{1,6}),"(.*)",(-?[0-9]{1,9})')
_EXPECTED = 'id,HEXRGB,"name",region (for example 12,0F3A9C,"chair",4)'


def parse_annotation(data: bytes, *, path: Path) -> tuple[SceneObject, ...]:
    """Parse the bytes of one `semantic.txt` into objects sorted by id, with their region ids."""
    lines = decode(data, path=path).split("\n")  # not splitlines(): a name may hold a U+2028
    if HEADER not in lines[0]:
        raise malformed(path, 1, lines[0], expected=repr(HEADER))
    objects: dict[int, SceneObject] = {}
    colours: set[str] = set()
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        match = _ROW.fullmatch(line.rstrip())
        if match is None:
            raise malformed(path, number, line, expected=_EXPECTED)
        instance_id, colour, region = int(match[1]), match[2].upper().zfill(6), int(match[4])
        if instance_id in objects or colour in colours:
            raise malformed(path, number, line, expected="an id and a colour of no earlier line")
        objects[instance_id] = SceneObject(0, instance_id, region, match[3], colour=colour)
        colours.add(colour)
    if not objects:
        raise malformed(path, 1, lines[0], expected="at least one annotated instance below")
    return tuple(objects[key] for key in sorted(objects))
