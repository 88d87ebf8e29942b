"""Zips of strangers: one member is read, and nothing else is trusted."""

from __future__ import annotations

import warnings
import zipfile
from pathlib import Path

import pytest

from bsg_data.errors import SourceError
from bsg_data.inputs import archive
from bsg_data.inputs.archive import read_member
from bsg_data.inputs.bounds import Bound

BOUND = Bound("", 100_000)


def write_zip(path: Path, *members: tuple[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a name twice, on purpose
        for name, data in members:
            file.writestr(name, data)
    return path


def test_a_member_is_found_in_whatever_folder(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", ("other", b""), ("in/here/table.csv", b"words"))
    assert read_member(path, "table.csv", BOUND) == b"words"


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ([("a/table.csv", b"1"), ("a/table.csv", b"2")], "two members are called 'a/table.csv'"),
        ([("a/table.csv", b"1"), ("b/table.csv", b"2")], "once, found it in 2 folders"),
        ([("table.csv", b"1"), ("../evil", b"2")], "'../evil' leads out of the zip"),
        ([("table.csv", b"1"), ("/etc/evil", b"2")], "'/etc/evil' leads out of the zip"),
        ([("table.csv", b"1"), ("a\\..\\..\\evil", b"2")], "leads out of the zip"),
        ([("other", b"1")], "expected table.csv inside, found other"),
        ([], "found nothing"),
        ([("table.csv", b"0" * 100_001)], "unpacks to more than 100,000 bytes"),
    ],
)
def test_a_zip_with_anything_odd_in_it_is_refused(
    tmp_path: Path, members: list[tuple[str, bytes]], said: str
) -> None:
    with pytest.raises(SourceError, match=said):
        read_member(write_zip(tmp_path / "a.zip", *members), "table.csv", BOUND)


def test_a_member_that_lies_about_its_size_is_still_bounded(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", ("table.csv", b"0" * 100_001))
    size = (100_001).to_bytes(4, "little")
    path.write_bytes(path.read_bytes().replace(size, (9).to_bytes(4, "little")))
    with pytest.raises(SourceError, match=r"unpacks to|not a readable zip"):
        read_member(path, "table.csv", BOUND)


def test_a_zip_of_too_many_members_or_bytes_a_link_and_none_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_zip(tmp_path / "a.zip", ("table.csv", b"1"), ("other", b"2"))
    with pytest.raises(SourceError, match="expected at most 9"):
        read_member(path, "table.csv", Bound("", 9))
    monkeypatch.setattr(archive, "MAX_MEMBERS", 1)
    with pytest.raises(SourceError, match="2 members; expected at most 1"):
        read_member(path, "table.csv", BOUND)
    link = zipfile.ZipInfo("table.csv")
    link.external_attr = 0o120777 << 16
    with zipfile.ZipFile(tmp_path / "link.zip", "w") as file:
        file.writestr(link, "/etc/passwd")
    with pytest.raises(SourceError, match="leads out of the zip"):
        read_member(tmp_path / "link.zip", "table.csv", BOUND)
    for place in (tmp_path, tmp_path / "none.zip"):
        with pytest.raises(SourceError, match="cannot be read"):
            read_member(place, "table.csv", BOUND)
