from __future__ import annotations

import hashlib
from collections import Counter
from importlib.resources import files
from pathlib import Path

import pytest
from conftest import SHARED
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import (
    Classified,
    list_class_maps,
    load_class_map,
    normalise_name,
    parse_own_map,
)
from bsg_data.scene.class_space import ClassSpace, load_class_space
from bsg_data.scene.own_map import read_own_map
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.hm3d_stats import HM3DStatistics

# The paper's own names (section IV); the other 23 are in mappings/README.md.
PAPER = (
    "chair,mirror,curtain,chandelier,stove,refrigerator,bathtub,clothes,floor mat,bookshelf,"
    "wardrobe,toilet,desk,bottle,plant,garbage bin,microwave,sink,vase,fan,paper,pillow"
)
# A published map never changes: a new map is a new version, added here.
PUBLISHED = {
    "hm3d45-v1": "46b5459227be1b27098463326f523e2e7149bb7168da928cbebdae982dfab9d3",
    "hm3d45-v2": "3abb4cd06c0724b3c3a0501904022a8d268f6cdcdfa82a37f0b5e44e4e189a53",
    "behavior45-v1": "1681e42ce541ad7b06d56c867c5a97b75b2d375b70b98d457e81a0e65d492190",
    "procthor45-v1": "8b08e6192018fd398f17b226c14bae13f6301fb968a8e47c4afd42deeff161b5",
    "mp3d45-v1": "f7d414db16fc3dcbca2043da327be4f5b003870ad2f701c2fc353b217cda8d88",
    "hm3d-wide-v1": "8c3e3acd5b560f2b651cf3429041ac3f343e6b33b340e0b73f8ad9fd648ff083",
}


def test_published_maps_never_change() -> None:
    assert {v: load_class_map(v).sha256 for v in list_class_maps()} == PUBLISHED


def test_the_map_has_the_papers_classes_among_its_45() -> None:
    class_map = load_class_map()
    assert len(class_map.classes) == len(set(class_map.classes)) == 45
    assert class_map.classes == tuple(sorted(class_map.classes))
    assert set(PAPER.split(",")) <= set(class_map.classes)
    assert all(definition.endswith(".") for definition in class_map.definitions)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("chair", "chair"),
        ("CHAIR", "chair"),
        ("  office   chair ", "chair"),
        ("armchair", "chair"),
        ("bed sheet", "blanket"),
        ("bed", "bed"),
        ("toilet", "toilet"),
        ("toilet paper", None),
        ("toilet paper holder", None),
        ("toilet brush", None),
        ("trash can", "garbage bin"),
        ("trashcan", "garbage bin"),
        ("fridge", "refrigerator"),
        ("shower curtain", "curtain"),
        ("shower wall", None),
        ("kitchen cabinet", "cabinet"),
        ("cabinet door", None),
        ("mirror frame", None),
        ("window frame", None),
        ("wall", None),
        ("unknown", None),
        ("", None),
        ("table lamp", "lamp"),
        ("bedside lamp", "lamp"),
        ("plush toy", "toy"),
        ("curtain rod", None),
        ("clothes hanger", None),
    ],
)
def test_names_whose_class_is_plain(name: str, expected: str | None) -> None:
    class_map = load_class_map()
    entry = class_map.lookup(name)
    assert entry is not None
    found = None if entry.class_index is None else class_map.classes[entry.class_index]
    assert found == expected


def test_structure_has_no_class_and_is_spelled_as_in_the_map() -> None:
    class_map = load_class_map()
    categories = {entry.category for entry in class_map.entries.values()}
    classified = {e.category for e in class_map.entries.values() if e.class_index is not None}
    assert class_map.structure <= categories
    assert not class_map.structure & classified
    assert {"wall", "floor", "ceiling", "door", "window", "stairs"} <= class_map.structure


def test_one_category_has_one_class() -> None:
    classes: dict[str, set[int | None]] = {}
    for entry in load_class_map().entries.values():
        classes.setdefault(entry.category, set()).add(entry.class_index)
    assert {name for name, found in classes.items() if len(found) > 1} == set()


def test_unmapped_names_have_neighbours() -> None:
    class_map = load_class_map()
    assert class_map.lookup("chairr") is None
    assert "chair" in class_map.nearest("chairr")
    with pytest.raises(ClassMapError, match=r"did you mean .*chair"):
        class_map.space.class_index("chairs")


@given(st.text())
def test_case_and_spaces_do_not_matter_to_a_name(name: str) -> None:
    assert normalise_name(f"  {name}\t") == normalise_name(name)
    assert normalise_name("Śign  A") == normalise_name("s\u0301ign a")


def test_sha256sums_are_those_of_the_files() -> None:
    folder = files("bsg_mappings")
    for line in folder.joinpath("SHA256SUMS").read_text("utf-8").splitlines():
        digest, name = line.split()
        assert hashlib.sha256(folder.joinpath(name).read_bytes()).hexdigest() == digest


def own_map(folder: Path, spellings: str, classes: str = "0,chair,A chair.\n") -> str:
    (folder / "own.csv").write_text(f"raw_category,category,class\n{spellings}", "utf-8")
    (folder / "own.classes.csv").write_text(f"index,class,definition\n{classes}", "utf-8")
    return str(folder / "own.csv")


def test_a_map_of_ones_own(tmp_path: Path) -> None:
    path = own_map(tmp_path, '"a ""big"", chair",chair,chair\nwall,wall,\n')
    class_map = load_class_map(path)
    assert class_map.version == "own"
    assert class_map.lookup('A  "BIG", chair') == class_map.entries['a "big", chair']
    assert class_map.space == ClassSpace.of("own", ("chair",))
    assert class_map.definitions == ("A chair.",)
    (tmp_path / "own.structure.csv").write_text("category\nwall\n", "utf-8")
    again = parse_own_map(read_own_map(Path(path)))
    assert again.sha256 != class_map.sha256  # roles are in the data, so structure counts


def test_a_map_of_ones_own_into_the_default_space(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    path.write_text("raw_category,category,class\nStuhl,Stuhl,chair\n", "utf-8")
    class_map = load_class_map(str(path))
    assert class_map.space == load_class_space()
    assert class_map.classes[class_map.classify("stuhl").class_index or 0] == "chair"


def test_rules_explain_what_is_not_listed(tmp_path: Path) -> None:
    rows = "tv,tv,tv\ntv stand,tv stand,\nshelf,shelf,shelf\nwall,wall,\n"
    path = own_map(tmp_path, rows, "0,tv,A tv.\n1,shelf,A shelf.\n")
    class_map = load_class_map(path)
    assert class_map.classify("TV-stand") == Classified("tv stand", None, "left-out", "separator")
    assert class_map.classify("shelves") == Classified("shelf", 1, "classified", "number")
    assert class_map.classify("Televisions") == Classified("tv", 0, "classified", "synonym")
    assert class_map.classify("oak shelf") == Classified("shelf", 1, "classified", "head noun")
    assert class_map.classify("garden wall") == Classified(None, None, "unmapped")  # no class


def test_the_first_map_has_no_rules() -> None:
    class_map = load_class_map("hm3d45-v1")
    assert class_map.classify("leather sofas") == Classified(None, None, "unmapped")
    both = [
        files("bsg_mappings").joinpath(f"hm3d45-v1{end}.csv").read_bytes()
        for end in ("", ".classes")
    ]
    assert class_map.sha256 == hashlib.sha256(b"".join(both)).hexdigest()


@pytest.mark.parametrize(
    ("spellings", "classes", "message"),
    [
        ("chair,chair,seat\n", "0,chair,A chair.\n", "'seat' is no class of own"),
        (
            "chair,chair,chair\nchair,chair,\n",
            "0,chair,A chair.\n",
            "line 3: 'chair' is listed twice",
        ),
        (
            "chair,chair,chair\nCHAIR,chair,\n",
            "0,chair,A chair.\n",
            "differs from an earlier row only",
        ),
        ("chair,chair\n", "0,chair,A chair.\n", "line 2: expected 3 fields, found 2"),
        ("chair,chair,chair\n", "1,chair,A chair.\n", "expected index 0"),
        ("chair,chair,chair\n", "", "1 to 256 classes"),
        ('"chair,chair,chair\n', "0,chair,A chair.\n", "not a readable CSV"),
    ],
)
def test_a_malformed_map_is_refused(
    tmp_path: Path, spellings: str, classes: str, message: str
) -> None:
    with pytest.raises(ClassMapError, match=message):
        load_class_map(own_map(tmp_path, spellings, classes))


@pytest.mark.parametrize(
    ("name", "category", "class_name", "role"),
    [
        ("CHAIR ", "chair", "chair", "classified"),
        ("tap", "tap", None, "left-out"),
        ("Wall", "wall", None, "structure"),
        ("unknown/remove", "unknown", None, "nameless"),  # no row of the map
        ("", "unknown", None, "nameless"),
        ("thingummy", "unknown", None, "nameless"),  # a row that says it is unknown
        ("zzqx", None, None, "unmapped"),
    ],
)
def test_a_name_has_one_category_class_and_role(
    tmp_path: Path, name: str, category: str | None, class_name: str | None, role: str
) -> None:
    rows = "chair,chair,chair\ntap,tap,\nwall,wall,\nthingummy,unknown,\n"
    path = Path(own_map(tmp_path, rows, "0,lamp,A lamp.\n1,chair,A chair.\n"))
    path.with_suffix(".structure.csv").write_text("category\nwall\n", "utf-8")
    class_map = load_class_map(str(path))
    class_index = None if class_name is None else class_map.space.class_index(class_name)
    assert class_map.classify(name) == Classified(category, class_index, role)  # type: ignore[arg-type]


def test_unknown_and_missing_maps_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ClassMapError, match=r"published are .*hm3d45-v1"):
        load_class_map("hm3d45-v0")
    with pytest.raises(ClassMapError, match="no such file"):
        load_class_map(str(tmp_path / "none.csv"))
    path = Path(own_map(tmp_path, ""))
    path.write_bytes(b"raw_category,category,class\n\xff,a,\n")
    with pytest.raises(ClassMapError, match="expected UTF-8"):
        load_class_map(str(path))


def test_raw_and_corrected_spellings_give_the_same_rooms(shared: Path) -> None:
    """All 2,066 rooms of the 145 scenes: the text's raw names against the zip's corrected ones.

    Of the first map. In later ones some raw spellings win over the public list
    (tests/mappings/test_hm3d45_v2.py).
    """
    class_map = load_class_map("hm3d45-v1")

    def rooms(source: HM3DFolder | HM3DStatistics) -> dict[tuple[str, int], Counter[int]]:
        found = {}
        for ref in source.find().scenes:
            graph = source.read(ref, class_map).graph
            region_of = {room.room_index: room.region_id for room in graph.rooms}
            for region in region_of.values():
                found[ref.scene_id, region] = Counter[int]()
            for obj in graph.objects:
                if obj.class_index is not None:
                    found[ref.scene_id, region_of[obj.room_index]][obj.class_index] += 1
        return found

    raw = rooms(HM3DFolder(shared / "annotations"))
    corrected = rooms(HM3DStatistics(shared / "HM3DSem-v0.2-train.zip"))
    assert len(raw) == 2066
    assert raw == corrected


@pytest.mark.skipif(not SHARED.is_dir(), reason="../shared is not on this machine")
def test_every_public_spelling_is_in_the_map() -> None:
    import csv

    vocabulary = SHARED.parent / "reference" / "hm3d_vocabulary.csv"
    with vocabulary.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    entries = load_class_map("hm3d45-v1").entries
    assert len(rows) == 2532
    assert [r["raw_category"] for r in rows if r["raw_category"] not in entries] == []
    wrong = [r for r in rows if entries[r["raw_category"]].category != r["category"]]
    assert wrong == []
