"""What the maps of other sources have in common with HM3D's, into whose class space they lead."""

from __future__ import annotations

import pytest

from bsg_data.scene.class_map import ClassMap, load_class_map, published_maps

HM3D = load_class_map("hm3d45-v2")
OTHERS = [row.class_map for row in published_maps().values() if row.source != "hm3d"]


@pytest.fixture(params=OTHERS)
def ours(request: pytest.FixtureRequest) -> ClassMap:
    """The map of one other source."""
    return load_class_map(request.param)


def test_a_category_that_hm3d_has_is_in_the_same_class_and_role(ours: ClassMap) -> None:
    for entry in ours.entries.values():
        listed = HM3D.lookup(entry.category)
        if listed is not None and listed.category == entry.category:
            assert listed.class_index == entry.class_index, entry
            structure = entry.category in ours.structure
            assert structure == (entry.category in HM3D.structure), entry


def test_one_category_has_one_class_and_structure_none(ours: ClassMap) -> None:
    classes = {(entry.category, entry.class_index) for entry in ours.entries.values()}
    assert len(classes) == len({category for category, _ in classes})
    assert {(name, None) for name in ours.structure} <= classes
