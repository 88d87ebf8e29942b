"""Buildings that share copied rooms stay together."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from bsg_data.dataset.copied_rooms import deal_groups, group_copies, list_contents
from bsg_data.dataset.dataset import Dataset

SCENES = st.dictionaries(
    st.text("abcdef", min_size=1, max_size=3), st.lists(st.integers(0, 9), max_size=3), max_size=9
)


@given(SCENES, st.integers(2, 4))
def test_no_room_is_in_two_folds(rooms: dict[str, list[int]], number: int) -> None:
    groups = group_copies(rooms)
    assert sorted(scene for group in groups for scene in group) == sorted(rooms)
    folds = deal_groups(groups, number=number)
    for a, some in rooms.items():
        for b, others in rooms.items():
            if set(some) & set(others):
                assert folds[a] == folds[b]


def test_rooms_that_hold_the_same_are_copies(dataset: Path) -> None:
    """The twelve buildings have one kitchen; a bathroom or bedroom of theirs is the same, too."""
    data = Dataset.open(dataset)
    contents = {scene: tuple(list_contents(data, scene)) for scene in data.scene_ids}
    assert {len(set(some)) for some in contents.values()} <= {2, 3}
    assert len(group_copies(contents)) == 1
