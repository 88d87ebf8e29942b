from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.errors import ClassMapError
from bsg_data.scene.own_map import OwnMap, read_own_map, write_own_map


@given(st.text(), st.none() | st.text(), st.none() | st.text())
def test_files_and_json_give_back_every_byte(
    tmp_path_factory: pytest.TempPathFactory,
    spellings: str,
    classes: str | None,
    structure: str | None,
) -> None:
    texts = (spellings, classes, structure)
    own = OwnMap.model_validate(
        dict(
            zip(
                ("spellings", "classes", "structure"),
                (None if text is None else text.encode() for text in texts),
                strict=True,
            ),
            name="mine",
        )
    )
    assert read_own_map(write_own_map(own, tmp_path_factory.mktemp("map"))) == own
    assert OwnMap.model_validate_json(own.model_dump_json()) == own


def test_a_missing_map_says_what_a_map_is(tmp_path: Path) -> None:
    with pytest.raises(ClassMapError, match=r"no such file; expected a class map NAME\.csv"):
        read_own_map(tmp_path / "mine.csv")


def test_a_file_that_is_no_class_map_is_refused(tmp_path: Path) -> None:
    (tmp_path / "large.csv").write_bytes(b"a" * (16 * 2**20 + 1))
    with pytest.raises(ClassMapError, match="expected at most 16,777,216"):
        read_own_map(tmp_path / "large.csv")
