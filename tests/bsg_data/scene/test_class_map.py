from __future__ import annotations

import hashlib
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import (
    Classified,
    OwnMap,
    list_class_maps,
    load_class_map,
    normalise_name,
    parse_own_map,
    published_maps,
    read_own_map,
    write_own_map,
)
from bsg_data.scene.class_space import (
    ClassSpace,
    find_wholes,
    list_class_spaces,
    load_class_space,
    parse_class_space,
)

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
    "cobie45-v1": "e095c02455cee270c908fd3328d2859514ddcb332b3ed2e278e3d2ac60378bcf",
    "s3dis45-v1": "17bfdf406f7f9f2106c27018221add0bdcc5312b7c3e369d95a1ca96c6dde5ad",
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
        ("  office   chair ", "chair"),
        ("bed sheet", "blanket"),
        ("toilet", "toilet"),
        ("toilet paper", None),
        ("trash can", "garbage bin"),
        ("fridge", "refrigerator"),
        ("shower curtain", "curtain"),
        ("cabinet door", None),
        ("wall", None),
        ("unknown", None),
        ("", None),
        ("plush toy", "toy"),
        ("curtain rod", None),
    ],
)
def test_names_whose_class_is_plain(name: str, expected: str | None) -> None:
    class_map = load_class_map()
    entry = class_map.lookup(name)
    assert entry is not None
    found = None if entry.class_index is None else class_map.classes[entry.class_index]
    assert found == expected


@given(st.text())
def test_case_and_spaces_do_not_matter_to_a_name(name: str) -> None:
    assert normalise_name(f"  {name}\t") == normalise_name(name)
    assert normalise_name("Śign  A") == normalise_name("s\u0301ign a")


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
    ("spellings", "classes"),
    [
        ("chair,chair,seat\n", "0,chair,A chair.\n"),  # no class
        ("chair,chair,chair\nchair,chair,\n", "0,chair,A chair.\n"),  # twice
        ("chair,chair,chair\nCHAIR,chair,\n", "0,chair,A chair.\n"),  # once with another class
        ("chair,chair\n", "0,chair,A chair.\n"),
        ("chair,chair,chair\n", "1,chair,A chair.\n"),
        ("chair,chair,chair\n", ""),
        ('"chair,chair,chair\n', "0,chair,A chair.\n"),
    ],
)
def test_a_malformed_map_is_refused(tmp_path: Path, spellings: str, classes: str) -> None:
    with pytest.raises(ClassMapError):
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
    (tmp_path / "large.csv").write_bytes(b"a" * (16 * 2**20 + 1))
    (tmp_path / "bytes.csv").write_bytes(b"raw_category,category,class\n\xff,a,\n")
    for name in ("hm3d45-v0", *(str(tmp_path / f"{n}.csv") for n in ("none", "large", "bytes"))):
        with pytest.raises(ClassMapError):
            load_class_map(name)


@given(st.text(), st.none() | st.text(), st.none() | st.text())
def test_files_and_json_give_back_every_byte_of_a_map(
    tmp_path_factory: pytest.TempPathFactory,
    spellings: str,
    classes: str | None,
    structure: str | None,
) -> None:
    own = OwnMap(
        name="mine",
        spellings=spellings.encode(),
        classes=None if classes is None else classes.encode(),
        structure=None if structure is None else structure.encode(),
    )
    assert read_own_map(write_own_map(own, tmp_path_factory.mktemp("map"))) == own
    assert OwnMap.model_validate_json(own.model_dump_json()) == own


@pytest.mark.parametrize(
    ("data", "is_read"),
    [
        (b"index,class,definition\n0,bed,A bed.\n1,tv,A tv.\n", True),
        (b"index,class,definition\n1,bed,A bed.\n", False),
        (b"index,class,definition\n0,bed,A.\n1,bed,B.\n", False),
        (b"index,class,definition\n", False),
        (b"class,index\n", False),
        (b"index,class,definition\n0,bed\n", False),
        (b"index,class,definition\n0,\xff,A.\n", False),
    ],
)
def test_a_class_space_by_hand(data: bytes, is_read: bool) -> None:
    if not is_read:
        with pytest.raises(ClassMapError):
            parse_class_space("two", data)
        return
    space, definitions = parse_class_space("two", data)
    assert (space.classes, definitions) == (("bed", "tv"), ("A bed.", "A tv."))
    assert space.sha256 == hashlib.sha256(b"bed\ntv").hexdigest()
    assert space.class_index("tv") == 1
    with refuses(ClassMapError, "class-unknown", where="beds"):
        space.class_index("beds")


def test_every_published_map_leads_into_a_published_space() -> None:
    spaces = list_class_spaces()
    assert {row.class_space for row in published_maps().values()} == set(spaces)
    assert [load_class_space(name).name for name in spaces] == list(spaces)
    with pytest.raises(ClassMapError):
        load_class_space("hm3d46")


def test_parts_are_those_of_the_classes() -> None:
    classes = load_class_space().classes
    found = find_wholes(("bath door", "wall", "basin faucet"), classes)
    assert found.tolist() == [classes.index("bathtub"), -1, classes.index("sink")]
