"""Parts of things, on files written by hand."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest

from bsg_data.errors import ClassMapError
from bsg_data.scene import parts as parts_module
from bsg_data.scene.parts import find_wholes, load_parts


def write(folder: Path, text: str) -> Path:
    path = folder / "parts.csv"
    path.write_text(text, "utf-8")
    return path


def test_parts_are_read_with_the_class_of_their_thing(tmp_path: Path) -> None:
    text = 'category,class\ncurtain rod,curtain\n"shower head, old",shower\n'
    parts = load_parts(write(tmp_path, text))
    assert dict(parts) == {"curtain rod": "curtain", "shower head, old": "shower"}
    found = find_wholes(["shower head, old", "", "curtain rod"], ["curtain", "bed"], parts)
    assert found.tolist() == [-1, -1, 0], "a space without showers has no wholes of their parts"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: expected category,class, found 'nothing'"),
        ("class,category\n", "line 1: expected category,class, found 'class,category'"),
        ("category,class\nrod\n", "line 2: expected a category and a class"),
        ("category,class\nrod,curtain\nrod,bed\n", "line 3: 'rod' is listed twice"),
        ("category,class\nrod,\n", "line 2: expected a category and a class"),
        ('category,class\n"rod,curtain\n', "expected a CSV file in UTF-8"),
    ],
)
def test_faults_are_named_with_their_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ClassMapError, match=message):
        load_parts(write(tmp_path, text))


def test_a_file_that_is_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(ClassMapError, match=r"nothing\.csv: cannot be read"):
        load_parts(tmp_path / "nothing.csv")
    (tmp_path / "latin.csv").write_bytes(b"category,class\nvent \xe9,fan\n")
    with pytest.raises(ClassMapError, match="expected a CSV file in UTF-8"):
        load_parts(tmp_path / "latin.csv")
    (tmp_path / "large.csv").write_bytes(b"x" * (parts_module.MAX_BYTES + 1))
    with pytest.raises(ClassMapError, match="more than 4,194,304 bytes"):
        load_parts(tmp_path / "large.csv")


def test_doctests() -> None:
    assert doctest.testmod(parts_module) == (0, 1)
