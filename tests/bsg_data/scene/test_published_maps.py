"""What holds for every published class map, read from its files."""

from __future__ import annotations

import csv
import unicodedata
from collections import Counter
from dataclasses import dataclass

import pytest
from conftest import REPOSITORY, SHARED

from bsg_data.scene.class_map import load_class_map, normalise_name
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HM3DStatistics

MAPPINGS = REPOSITORY / "mappings"


def read(name: str) -> list[dict[str, str]]:
    with (MAPPINGS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, strict=True))


MAPS = {row["class_map"]: row for row in read("class_maps.csv")}
SPACES = sorted({row["class_space"] for row in MAPS.values()})
OF_HM3D = [name for name, row in MAPS.items() if row["source"] == "hm3d"]
# In how many of the 145 train scenes each class of a space stands at least.
SCENES = {"hm3d45-v1": 20, "hm3d45-v2": 20, "hm3d-wide-v1": 10}
# How many of the 96,110 objects have another class by their spelling than by the corrected name.
SPELLING_WINS = {"hm3d45-v1": 0, "hm3d45-v2": 94, "hm3d-wide-v1": 95}
each_map = pytest.mark.parametrize("name", MAPS)
each_space = pytest.mark.parametrize("space", SPACES)
each_map_of_hm3d = pytest.mark.parametrize("name", OF_HM3D)


def classes_of(space: str) -> list[str]:
    return [row["class"] for row in read(f"{space}.classes.csv")]


@each_space
def test_classes_are_in_alphabetical_order_and_a_robots_words(space: str) -> None:
    names = classes_of(space)
    assert [row["index"] for row in read(f"{space}.classes.csv")] == [
        str(i) for i in range(len(names))
    ]
    assert names == sorted(set(names))
    assert all(name == normalise_name(name) for name in names)
    assert all(
        character.isascii() and (character.isalpha() or character == " ")
        for name in names
        for character in name
    )


@each_space
def test_a_definition_is_one_sentence(space: str) -> None:
    for row in read(f"{space}.classes.csv"):
        text = row["definition"]
        assert text.endswith("."), row
        assert ". " not in text, row
        assert text[0].isupper(), row


def test_a_wide_definition_says_what_is_not_in_the_class() -> None:
    """Neighbours are near among 170 classes; the 45 say it where it is in doubt."""
    rows = read("hm3d-wide-v1.classes.csv")
    assert [row["class"] for row in rows if "; not " not in row["definition"]] == []


@each_map_of_hm3d
def test_every_class_of_the_space_has_a_spelling_of_hm3d(name: str) -> None:
    found = {row["class"] for row in read(f"{name}.csv")} - {""}
    assert found == set(classes_of(MAPS[name]["class_space"]))


@each_map
def test_one_category_has_one_class_and_one_name_one_row(name: str) -> None:
    rows = read(f"{name}.csv")
    assert len({row["raw_category"] for row in rows}) == len(rows)
    of_category: dict[str, set[str]] = {}
    of_name: dict[str, set[str]] = {}
    for row in rows:
        of_category.setdefault(row["category"], set()).add(row["class"])
        of_name.setdefault(normalise_name(row["raw_category"]), set()).add(row["class"])
    assert {c: found for c, found in of_category.items() if len(found) > 1} == {}
    assert {n: found for n, found in of_name.items() if len(found) > 1} == {}


@each_map
def test_structure_is_sorted_spelled_as_in_the_map_and_has_no_class(name: str) -> None:
    structure = [row["category"] for row in read(f"{name}.structure.csv")]
    rows = read(f"{name}.csv")
    assert structure == sorted(set(structure))
    assert set(structure) <= {row["category"] for row in rows}
    assert set(structure) & {row["category"] for row in rows if row["class"]} == set()


@each_map
def test_files_end_lines_with_a_line_feed_and_are_nfc(name: str) -> None:
    space = MAPS[name]["class_space"]
    for file in (f"{name}.csv", f"{name}.structure.csv", f"{space}.classes.csv"):
        text = (MAPPINGS / file).read_bytes().decode("utf-8")
        assert text.endswith("\n"), file
        assert "\r" not in text, file
        assert file == f"{name}.csv" or unicodedata.is_normalized("NFC", text), file


@each_map_of_hm3d
def test_a_map_of_hm3d_has_a_row_for_every_spelling_of_the_first(name: str) -> None:
    first = {row["raw_category"] for row in read("hm3d45-v1.csv")}
    assert first - {row["raw_category"] for row in read(f"{name}.csv")} == set()


@each_map_of_hm3d
@pytest.mark.skipif(not SHARED.is_dir(), reason="../shared is not on this machine")
def test_every_public_spelling_is_in_a_map_of_hm3d(name: str) -> None:
    vocabulary = SHARED.parent / "reference" / "hm3d_vocabulary.csv"
    with vocabulary.open(encoding="utf-8", newline="") as file:
        public = [row["raw_category"] for row in csv.DictReader(file)]
    assert set(public) - {row["raw_category"] for row in read(f"{name}.csv")} == set()


@each_map_of_hm3d
def test_it_knows_the_categories_that_labels_of_robots_lead_to(name: str) -> None:
    known = {row["category"] for row in read(f"{name}.csv")}
    for labels in ("labels-ade20k.csv", "labels-mpcat40.csv"):
        assert {row["category"] for row in read(labels)} <= known, labels


@dataclass(frozen=True)
class Scan:
    """The 96,110 objects of the 145 train scenes, once as annotated and once as corrected.

    Attributes:
        names: raw and corrected name of every object.
        places: scene and room of every object.
    """

    names: list[tuple[str, str]]
    places: list[tuple[str, int]]

    def classes(self, name: str, *, corrected: bool) -> list[int | None]:
        class_map = load_class_map(name)
        return [class_map.classify(names[corrected]).class_index for names in self.names]


@pytest.fixture(scope="module")
def scan() -> Scan:
    if not SHARED.is_dir():
        pytest.skip("../shared/hm3d is not on this machine")
    raw = names_by_instance(HM3DFolder(SHARED / "annotations"))
    corrected = names_by_instance(HM3DStatistics(SHARED / "HM3DSem-v0.2-train.zip"))
    assert len(raw) == 96_110
    assert raw.keys() == corrected.keys()
    pairs = [(name, corrected[key]) for key, name in raw.items()]
    return Scan(pairs, [(scene, room) for scene, room, _ in raw])


def names_by_instance(source: HM3DFolder | HM3DStatistics) -> dict[tuple[str, int, int], str]:
    class_map = load_class_map("hm3d45-v1")
    return {
        (ref.scene_id, obj.room_index, obj.instance_id): obj.raw_category
        for ref in source.find().scenes
        for obj in source.read(ref, class_map).graph.objects
    }


@each_map_of_hm3d
@pytest.mark.parametrize("corrected", [False, True])
def test_each_class_stands_in_enough_scenes(name: str, corrected: bool, scan: Scan) -> None:
    found = zip(scan.classes(name, corrected=corrected), scan.places, strict=True)
    scenes = Counter(index for index, _ in {(index, scene) for index, (scene, _) in found})
    space = MAPS[name]["class_space"]
    few = {c: scenes[i] for i, c in enumerate(classes_of(space)) if scenes[i] < SCENES[space]}
    assert few == {}


@each_map_of_hm3d
def test_raw_and_corrected_names_have_one_class_but_where_the_spelling_wins(
    name: str, scan: Scan
) -> None:
    """A spelling wins where the map gives it another category than the public list does."""
    class_map = load_class_map(name)
    for raw, corrected in set(scan.names):
        spelled = class_map.lookup(raw)
        assert spelled is not None, raw
        if spelled.category == corrected:
            found, public = class_map.classify(raw), class_map.classify(corrected)
            assert (found.class_index, found.role) == (public.class_index, public.role), raw
    both = zip(scan.classes(name, corrected=False), scan.classes(name, corrected=True), strict=True)
    assert sum(raw != corrected for raw, corrected in both) == SPELLING_WINS[name]


def test_the_table_of_the_wide_classes_is_what_is_counted(scan: Scan) -> None:
    text = (MAPPINGS / "hm3d-wide-v1.md").read_text("utf-8")
    written = {
        cells[0]: tuple(int(cell.replace(",", "")) for cell in cells[2:])
        for line in text.splitlines()
        if len(cells := [cell.strip() for cell in line.strip("|").split("|")]) == 5
        and cells[4].isdigit()
    }
    classes = classes_of("hm3d-wide-v1")
    places: dict[int, list[tuple[str, int]]] = {i: [] for i in range(len(classes))}
    found = scan.classes("hm3d-wide-v1", corrected=False)
    for index, place in zip(found, scan.places, strict=True):
        if index is not None:
            places[index].append(place)
    counted = {
        classes[index]: (len(objects), len(set(objects)), len({scene for scene, _ in objects}))
        for index, objects in places.items()
    }
    assert written == counted


def test_the_wide_map_agrees_with_the_45_of_v2() -> None:
    """What has a class of 45 has a wide one; four wide classes lie across the edge of the 45."""
    narrow = {row["category"]: row["class"] for row in read("hm3d45-v2.csv")}
    wide = {row["category"]: row["class"] for row in read("hm3d-wide-v1.csv")}
    assert narrow.keys() == wide.keys()
    assert [category for category, found in narrow.items() if found and not wide[category]] == []
    of_wide: dict[str, set[str]] = {}
    for category, found in wide.items():
        of_wide.setdefault(found, set()).add(narrow[category])
    del of_wide[""]
    across = {name for name, found in of_wide.items() if len(found) > 1}
    assert across == {"computer", "detergent", "soap", "tissue box"}
    assert all(len(of_wide[name] - {""}) == 1 for name in across)
    assert read("hm3d45-v2.structure.csv") == read("hm3d-wide-v1.structure.csv")
