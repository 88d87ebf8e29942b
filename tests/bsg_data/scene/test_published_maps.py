"""What holds for every published class map, read from its files; a new version must keep it."""

from __future__ import annotations

import csv
import shutil
import unicodedata
from collections import defaultdict
from pathlib import Path

import pytest
from conftest import REPOSITORY
from refusals import refuses

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.class_space import read_published
from bsg_data.seal import require_seal
from bsg_data.words.normal import normalise_name

MAPPINGS, TABLES = REPOSITORY / "mappings", REPOSITORY / "bsg_robot/tables"


def read(name: str) -> list[dict[str, str]]:
    with (MAPPINGS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


MAPS = {row["class_map"]: row for row in read("class_maps.csv")}


def test_every_file_of_data_is_listed_with_its_hash() -> None:
    """Texts for people are not: `README.md`, and what says how a file was made."""
    for folder, package in ((MAPPINGS, "bsg_mappings"), (TABLES, "bsg_robot.tables")):
        data = {path.name for path in folder.iterdir() if path.suffix not in (".md", ".py", "")}
        assert data - {"__pycache__"} == set(require_seal(folder) or ())
        for name in sorted(data):
            assert read_published(name, folder=package) == (folder / name).read_bytes()


def test_a_changed_file_is_found_when_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mappings = Path(shutil.copytree(MAPPINGS, tmp_path / "mappings"))
    monkeypatch.setattr("bsg_data.scene.class_space.files", lambda package: mappings)
    for name in ("class_maps.csv", "labels-ade20k.csv"):
        data = bytearray((mappings / name).read_bytes())
        data[len(data) // 2] ^= 1
        (mappings / name).write_bytes(data)
        with refuses(ClassMapError, "file-changed", name):
            read_published(name)


@pytest.mark.parametrize("space", sorted({row["class_space"] for row in MAPS.values()}))
def test_classes_are_sorted_words_and_a_definition_is_one_sentence(space: str) -> None:
    rows = read(f"{space}.classes.csv")
    names = [row["class"] for row in rows]
    assert [row["index"] for row in rows] == [str(i) for i in range(len(names))]
    assert names == sorted(set(names))
    for row in rows:
        assert row["class"] == normalise_name(row["class"])
        assert row["class"].replace(" ", "").isascii()
        assert row["class"].replace(" ", "").isalpha()
        assert row["definition"].endswith(".")
        assert ". " not in row["definition"]
        assert row["definition"][0].isupper()


@pytest.mark.parametrize("name", [n for n, row in MAPS.items() if row["source"] == "hm3d"])
def test_every_class_has_a_spelling_of_hm3d_and_every_label_of_a_robot_a_row(name: str) -> None:
    rows = read(f"{name}.csv")
    classes = {row["class"] for row in read(f"{MAPS[name]['class_space']}.classes.csv")}
    assert {row["class"] for row in rows} - {""} == classes
    categories = {row["category"] for row in rows}
    for labels in ("labels-ade20k.csv", "labels-mpcat40.csv"):
        assert {row["category"] for row in read(labels)} <= categories, labels


@pytest.mark.parametrize("name", MAPS)
def test_one_category_has_one_class_one_name_one_row_and_structure_none(name: str) -> None:
    rows = read(f"{name}.csv")
    assert len({row["raw_category"] for row in rows}) == len(rows)
    classes = defaultdict(set)
    for row in rows:
        classes[row["category"]].add(row["class"])
        classes[normalise_name(row["raw_category"]), "name"].add(row["class"])
    assert {one: found for one, found in classes.items() if len(found) > 1} == {}
    listed = load_class_map(name)
    assert {one: listed.classify(one) for one in listed.entries} == dict(listed.entries)
    structure = [row["category"] for row in read(f"{name}.structure.csv")]
    assert structure == sorted(set(structure))
    assert all(classes[category] == {""} for category in structure)


def test_files_end_lines_with_a_line_feed_and_are_nfc() -> None:
    for path in MAPPINGS.glob("*.csv"):
        text = path.read_bytes().decode("utf-8")
        assert text.endswith("\n"), path
        assert "\r" not in text, path
        assert path.stem in MAPS or unicodedata.is_normalized("NFC", text), path


@pytest.mark.parametrize("name", [n for n, r in MAPS.items() if r["class_space"] == "hm3d45-v1"])
def test_a_category_that_hm3d_has_is_in_the_same_class_and_role(name: str) -> None:
    ours, hm3d = load_class_map(name), load_class_map("hm3d45-v1")
    for entry in ours.entries.values():
        listed = hm3d.lookup(entry.category or "")
        if listed is not None and listed.category == entry.category:
            assert listed.class_index == entry.class_index, entry
            assert (entry.category in ours.structure) == (entry.category in hm3d.structure), entry
