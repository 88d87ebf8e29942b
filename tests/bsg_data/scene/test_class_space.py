from __future__ import annotations

import hashlib

import pytest

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import published_maps
from bsg_data.scene.class_space import (
    hash_classes,
    list_class_spaces,
    load_class_space,
    parse_class_space,
)


def test_a_space_by_hand() -> None:
    space, definitions = parse_class_space(
        "two", b"index,class,definition\n0,bed,A bed.\n1,tv,A tv.\n"
    )
    assert space.classes == ("bed", "tv")
    assert definitions == ("A bed.", "A tv.")
    assert space.sha256 == hashlib.sha256(b"bed\ntv").hexdigest() == hash_classes(["bed", "tv"])
    assert space.class_index("tv") == 1
    with pytest.raises(ClassMapError, match="'beds' is not a class of two; did you mean bed"):
        space.class_index("beds")


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"index,class,definition\n1,bed,A bed.\n", "line 2: expected index 0"),
        (b"index,class,definition\n0,bed,A.\n1,bed,B.\n", "line 3: expected index 1 and a new"),
        (b"index,class,definition\n", "expected 1 to 256 classes, found 0"),
        (b"class,index\n", "line 1: expected index,class,definition"),
        (b"index,class,definition\n0,bed\n", "line 2: expected 3 fields, found 2"),
        (b"index,class,definition\n0,\xff,A.\n", "expected UTF-8"),
    ],
)
def test_a_malformed_space_is_refused(data: bytes, expected: str) -> None:
    with pytest.raises(ClassMapError, match=expected):
        parse_class_space("two", data)


def test_every_published_map_leads_into_a_published_space() -> None:
    spaces = list_class_spaces()
    assert {row.class_space for row in published_maps().values()} == set(spaces)
    assert [load_class_space(name).name for name in spaces] == list(spaces)
    with pytest.raises(ClassMapError, match="no class space 'hm3d46'"):
        load_class_space("hm3d46")
