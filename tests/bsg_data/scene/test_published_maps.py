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
from bsg_data.scene.class_map import load_class_map, normalise_name
from bsg_data.scene.class_space import read_published
from bsg_data.seal import require_seal

MAPPINGS = REPOSITORY / "mappings"
# A published map never changes: a new map is a new version, added here.
PUBLISHED = {
    "hm3d45-v1": "46b5459227be1b27098463326f523e2e7149bb7168da928cbebdae982dfab9d3",
    "hm3d45-v2": "763b3a963ced00e07bf14b9bb5a98f09d63f61f76d9d8ae5682ddabc530325cd",
    "behavior45-v1": "a4856c8c77f763797e96462764b4c516b68eb29a14531768d5eb520a396778b4",
    "procthor45-v1": "84c1b0e30637dd74618873bd3115ed7b5c3b0ef2d1d2cc3058909b7397e4797d",
    "mp3d45-v1": "9a39b400368c566e0bea80f4e8bb313fb9b93d71ee2d6b7ff03601b008fc76aa",
    "hm3d-wide-v1": "b62764ed3765ce039c1ff40f66635ce3837a572e8c868fd4abaaee94966615ee",
    "cobie45-v1": "e4434c5f951f81238c72909f5d17df2005f2c9bfd812060c2ac01252d45ebd65",
    "s3dis45-v1": "4457c23558a3cf9294f4cae39235d428187340dfb1f3cda76dce474013b8065b",
}
# Their hashes by the rules of version 1, which older datasets have.
FORMER = {
    "hm3d45-v1": "46b5459227be1b27098463326f523e2e7149bb7168da928cbebdae982dfab9d3",
    "hm3d45-v2": "3abb4cd06c0724b3c3a0501904022a8d268f6cdcdfa82a37f0b5e44e4e189a53",
    "behavior45-v1": "1681e42ce541ad7b06d56c867c5a97b75b2d375b70b98d457e81a0e65d492190",
    "procthor45-v1": "8b08e6192018fd398f17b226c14bae13f6301fb968a8e47c4afd42deeff161b5",
    "mp3d45-v1": "f7d414db16fc3dcbca2043da327be4f5b003870ad2f701c2fc353b217cda8d88",
    "hm3d-wide-v1": "8c3e3acd5b560f2b651cf3429041ac3f343e6b33b340e0b73f8ad9fd648ff083",
    "cobie45-v1": "e095c02455cee270c908fd3328d2859514ddcb332b3ed2e278e3d2ac60378bcf",
    "s3dis45-v1": "17bfdf406f7f9f2106c27018221add0bdcc5312b7c3e369d95a1ca96c6dde5ad",
}


def read(name: str) -> list[dict[str, str]]:
    with (MAPPINGS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


MAPS = {row["class_map"]: row for row in read("class_maps.csv")}
OF_HM3D = [name for name, row in MAPS.items() if row["source"] == "hm3d"]
each_map = pytest.mark.parametrize("name", MAPS)
each_map_of_hm3d = pytest.mark.parametrize("name", OF_HM3D)


def test_published_maps_never_change() -> None:
    maps = {name: load_class_map(name) for name in MAPS}
    assert {name: one.sha256 for name, one in maps.items()} == PUBLISHED
    assert {name: (one.former or one).sha256 for name, one in maps.items()} == FORMER


def test_every_file_of_data_is_listed_with_its_hash() -> None:
    """Texts for people are not: `README.md`, and what says how a file was made."""
    data = {path.name for path in MAPPINGS.iterdir() if path.suffix not in (".md", ".py", "")}
    assert data == set(require_seal(MAPPINGS) or ())
    for name in sorted(data):
        assert read_published(name) == (MAPPINGS / name).read_bytes()


def test_a_changed_file_is_found_when_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mappings = Path(shutil.copytree(MAPPINGS, tmp_path / "mappings"))
    monkeypatch.setattr("bsg_data.scene.class_space.files", lambda package: mappings)
    for name in ("class_maps.csv", "labels-ade20k.csv", "nouns-v1.safetensors", "things-v1.csv"):
        data = bytearray((mappings / name).read_bytes())
        data[len(data) // 2] ^= 1
        (mappings / name).write_bytes(data)
        with refuses(ClassMapError, "file-changed", name):
            read_published(name)


@each_map
def test_what_a_map_lists_is_the_same_by_all_rules(name: str) -> None:
    now = load_class_map(name)
    before = now.with_hash(FORMER[name])
    assert before.sha256 == FORMER[name]
    assert {one: now.classify(one) for one in now.entries} == dict(now.entries)
    assert {one: before.classify(one) for one in now.entries} == dict(now.entries)
    assert now.with_hash("another") is now


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


@each_map_of_hm3d
def test_every_class_has_a_spelling_of_hm3d_and_no_spelling_is_lost(name: str) -> None:
    rows = read(f"{name}.csv")
    classes = {row["class"] for row in read(f"{MAPS[name]['class_space']}.classes.csv")}
    assert {row["class"] for row in rows} - {""} == classes
    spellings = {row["raw_category"] for row in rows}
    assert {row["raw_category"] for row in read("hm3d45-v1.csv")} <= spellings
    categories = {row["category"] for row in rows}
    for labels in ("labels-ade20k.csv", "labels-mpcat40.csv"):
        assert {row["category"] for row in read(labels)} <= categories, labels


@each_map
def test_one_category_has_one_class_one_name_one_row_and_structure_none(name: str) -> None:
    rows = read(f"{name}.csv")
    assert len({row["raw_category"] for row in rows}) == len(rows)
    classes = defaultdict(set)
    for row in rows:
        classes[row["category"]].add(row["class"])
        classes[normalise_name(row["raw_category"]), "name"].add(row["class"])
    assert {one: found for one, found in classes.items() if len(found) > 1} == {}
    structure = [row["category"] for row in read(f"{name}.structure.csv")]
    assert structure == sorted(set(structure))
    assert all(classes[category] == {""} for category in structure)


@each_map
def test_files_end_lines_with_a_line_feed_and_are_nfc(name: str) -> None:
    space = MAPS[name]["class_space"]
    for file in (f"{name}.csv", f"{name}.structure.csv", f"{space}.classes.csv"):
        text = (MAPPINGS / file).read_bytes().decode("utf-8")
        assert text.endswith("\n"), file
        assert "\r" not in text, file
        assert file == f"{name}.csv" or unicodedata.is_normalized("NFC", text), file


@each_map
def test_a_category_that_hm3d_has_is_in_the_same_class_and_role(name: str) -> None:
    ours, hm3d = load_class_map(name), load_class_map("hm3d45-v2")
    if ours.classes != hm3d.classes or name == "hm3d45-v1":
        pytest.skip("of other classes, or of an earlier version")
    for entry in ours.entries.values():
        listed = hm3d.lookup(entry.category or "")
        if listed is not None and listed.category == entry.category:
            assert listed.class_index == entry.class_index, entry
            assert (entry.category in ours.structure) == (entry.category in hm3d.structure), entry
