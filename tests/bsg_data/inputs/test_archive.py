"""Zips of others: one member is read, within its bound."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.inputs.bounded_file import read_member
from bsg_data.inputs.bounds import Bound

BOUND = Bound("", 100_000)


def write_zip(path: Path, *members: tuple[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members:
            file.writestr(name, data)
    return path


def test_a_member_is_found_in_whatever_folder(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", ("other", b""), ("in/here/table.csv", b"words"))
    assert read_member(path, "table.csv", BOUND) == b"words"


@pytest.mark.parametrize(
    ("members", "code"),
    [
        ([("a/table.csv", b"1"), ("b/table.csv", b"2")], "zip-member-missing"),
        ([("other", b"1")], "zip-member-missing"),
        ([("table.csv", b"0" * 100_001)], "file-too-large"),
    ],
)
def test_a_member_is_there_once_and_within_its_bound(
    tmp_path: Path, members: list[tuple[str, bytes]], code: str
) -> None:
    path = write_zip(tmp_path / "a.zip", *members)
    with refuses(SourceError, code, path):
        read_member(path, "table.csv", BOUND)


def test_what_is_no_zip_or_is_damaged_is_one_error(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", ("table.csv", b"words" * 99))
    data = path.read_bytes()
    for damaged in (b"", b"PK", data[: len(data) // 2], data.replace(b"PK\x03\x04", b"PK\x03\x05")):
        path.write_bytes(damaged)
        with refuses(SourceError, "file-unreadable", path, golden=False):
            read_member(path, "table.csv", BOUND)
