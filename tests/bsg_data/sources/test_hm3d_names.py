from __future__ import annotations

import pytest

from bsg_data.sources.hm3d_names import keep_one_copy, split_by_number, split_of_folder
from bsg_data.sources.source import SceneRef


@pytest.mark.parametrize(
    ("number", "split"),
    [(0, "train"), (799, "train"), (800, "val"), (899, "val"), (900, "test"), (1000, None)],
)
def test_the_number_says_the_split(number: int, split: str | None) -> None:
    assert split_by_number(f"{number:05d}-aaaaaaaaaaa") == split
    assert split_by_number("aaaaaaaaaaa") is None


def test_a_folder_says_the_split_only_by_its_whole_name() -> None:
    assert split_of_folder("minival") == "minival"
    assert split_of_folder("hm3d-val-semantic-annots-v0.2") == "val"
    assert split_of_folder("validation") is None


def test_a_numbered_copy_then_the_newest_then_the_split_is_kept() -> None:
    copies = [
        SceneRef("a", "hash/alone", "f", "train", "v0.9"),
        SceneRef("00001-a", "minival", "f", "minival", "v0.10"),
        SceneRef("00001-a", "val", "f", "val", "v0.10"),
        SceneRef("00001-a", "older", "g", "train", "v0.2"),
    ]
    kept = keep_one_copy(copies)
    assert [ref.location for ref in kept.scenes] == ["val"]
    assert [(skip.location, skip.reason.split()[-2]) for skip in kept.duplicates] == [
        ("hash/alone", "same"),
        ("minival", "same"),
        ("older", "OTHER"),
    ]
