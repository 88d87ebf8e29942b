from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import (
    Classified,
    OwnMap,
    load_class_map,
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
from bsg_data.words.normal import LONGEST

# The paper's own names (section IV); the other 23 are in mappings/hm3d45-v1.md.
PAPER = (
    "chair,mirror,curtain,chandelier,stove,refrigerator,bathtub,clothes,floor mat,bookshelf,"
    "wardrobe,toilet,desk,bottle,plant,garbage bin,microwave,sink,vase,fan,paper,pillow"
)
HEADER = "raw_category,category,class\n"


def own_map(folder: Path, spellings: str, classes: str = "0,chair,A chair.\n") -> str:
    (folder / "own.csv").write_text(f"{HEADER}{spellings}", "utf-8")
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
    (tmp_path / "own.classes.csv").unlink()
    assert parse_own_map(read_own_map(Path(path))).space == load_class_space()


RULED = """television,television,screen
armchair,seat,chair
monitor,monitor,
dining table,dining table,table
object of art,art,
shelf,shelf,shelf
tv stand,tv stand,
wall,wall,
basket,basket,basket
towel,towel,towel
"""
CLASSES = ["screen", "chair", "table", "shelf", "basket", "towel"]
CLASS_ROWS = "".join(f"{number},{one},A.\n" for number, one in enumerate(CLASSES))


# name → category, class, rule
READ: dict[str, tuple[str, str | None, str]] = {
    "TV-stand_3": ("tv stand", None, "separator"),
    "dining--table": ("dining table", "table", "separator"),
    "DiningTable": ("dining table", "table", "separator"),
    "old DiningTable.002": ("dining table", "table", "head noun"),
    "tv": ("television", "screen", "vocabulary"),  # a vocabulary leads to it
    "tv_monitor_2": ("television", "screen", "vocabulary"),
    "old tv-monitor": ("television", "screen", "head noun"),
    "flatscreen": ("television", "screen", "synonym"),
    "seat": ("seat", "chair", "vocabulary"),  # its category
    "chair": ("seat", "chair", "vocabulary"),  # its class
    "walls": ("wall", None, "number"),
    "towels": ("towel", "towel", "number"),
    "oak shelves": ("shelf", "shelf", "head noun"),
    "basket of towels": ("basket", "basket", "head noun"),
    "a pile of towels": ("towel", "towel", "head noun"),
    "lamp/shelf": ("shelf", "shelf", "phrase"),
    "towl basket": ("basket", "basket", "head noun"),
    "televsion": ("television", "screen", "spelling"),
}
UNREAD = ["garden wall", "ArtObject", "laptop", "baby monitor", "old baby monitor", "#3"]


def test_a_rule_reads_what_is_not_listed_unless_its_last_word_has_no_class(tmp_path: Path) -> None:
    classify = load_class_map(own_map(tmp_path, RULED, CLASS_ROWS)).classify
    for name, (category, class_name, rule) in READ.items():
        index = None if class_name is None else CLASSES.index(class_name)
        found = classify(name)
        assert (found.category, found.class_index, found.rule) == (category, index, rule), name
    assert {name: classify(name).role for name in UNREAD} == dict.fromkeys(UNREAD, "unmapped")


def test_a_typo_is_mended_if_what_it_may_be_is_one_class(tmp_path: Path) -> None:
    rows = "closet,closet,wardrobe\ncloset door,closet door,\nclosed cabinet,cabinet,\n"
    rows += "marker pen,marker,\nmarket stall,stall,stall\n"
    class_map = load_class_map(own_map(tmp_path, rows, "0,stall,A.\n1,wardrobe,A.\n"))
    assert class_map.classify("closset") == Classified("closet", 1, "classified", "spelling")
    assert class_map.classify("Closset door").role == "unmapped", "it has no class"
    assert class_map.classify("markes stall").category == "stall"
    assert class_map.classify("closes").role == "unmapped", "a word of English"


@pytest.mark.parametrize(
    ("spellings", "classes"),
    [
        ("chair,chair,seat\n", "0,chair,A chair.\n"),  # no class
        ("chair,chair,chair\nchair,chair,\n", "0,chair,A chair.\n"),  # twice
        ("chair,chair\n", "0,chair,A chair.\n"),
        ("chair,chair,chair\n", "0,chair,A.\n0,chair,B.\n"),
        ("chair,chair,chair\n", ""),
        ('"chair,chair,chair\n', "0,chair,A chair.\n"),
        ("\udcff,chair,\n", "0,chair,A.\n"),  # no UTF-8
        ("a" * (16 * 2**20), "0,chair,A.\n"),
    ],
    ids=range(8),
)
def test_a_malformed_map_is_refused_in_few_words(
    tmp_path: Path, spellings: str, classes: str
) -> None:
    path = Path(own_map(tmp_path, "", classes))
    path.write_bytes(f"{HEADER}{spellings}".encode("utf-8", "surrogateescape"))
    for name in (str(path), "hm3d45-v0", str(tmp_path / "none.csv")):
        with pytest.raises(ClassMapError) as caught:
            load_class_map(name)
        assert len(str(caught.value).replace(str(tmp_path), "")) < 300


def test_a_name_has_one_category_class_and_role(tmp_path: Path) -> None:
    rows = "chair,chair,chair\ntap,tap,\nwall,wall,\nthingummy,unknown,\n"
    path = Path(own_map(tmp_path, rows, "0,lamp,A lamp.\n1,chair,A chair.\n"))
    path.with_suffix(".structure.csv").write_text("category\nwall\n", "utf-8")
    class_map = load_class_map(str(path))
    expected = {
        "CHAIR ": Classified("chair", 1, "classified"),
        "tap": Classified("tap", None, "left-out"),
        "Wall": Classified("wall", None, "structure"),
        "unknown/remove": Classified("unknown", None, "nameless"),  # no row of the map
        "": Classified("unknown", None, "nameless"),
        "thingummy": Classified("unknown", None, "nameless"),  # a row that says it is unknown
        "zzqx": Classified(None, None, "unmapped"),
    }
    assert {name: class_map.classify(name) for name in expected} == expected


@settings(max_examples=30)
@given(st.binary(), st.none() | st.binary(), st.none() | st.binary())
def test_files_and_json_give_back_every_byte_of_a_map(
    tmp_path_factory: pytest.TempPathFactory,
    spellings: bytes,
    classes: bytes | None,
    structure: bytes | None,
) -> None:
    own = OwnMap(name="mine", spellings=spellings, classes=classes, structure=structure)
    assert read_own_map(write_own_map(own, tmp_path_factory.mktemp("map"))) == own


def test_class_spaces() -> None:
    data = b"index,class,definition\n0,bed,A bed.\n1,tv,A tv.\n"
    space, definitions = parse_class_space("two", data)
    assert (space.classes, definitions) == (("bed", "tv"), ("A bed.", "A tv."))
    assert space.sha256 == hashlib.sha256(b"bed\ntv").hexdigest()
    assert space.class_index("tv") == 1
    with refuses(ClassMapError, "class-unknown", where="beds"):
        space.class_index("beds")
    assert {row.class_space for row in published_maps().values()} == set(list_class_spaces())
    with pytest.raises(ClassMapError):
        load_class_space("hm3d46")
    classes = load_class_space().classes
    assert len(classes) == 45
    assert {*PAPER.split(",")} <= {*classes}
    found = find_wholes(("bath door", "wall", "basin faucet"), classes)
    assert found.tolist() == [classes.index("bathtub"), -1, classes.index("sink")]


def test_no_rule_reads_a_name_that_is_too_long() -> None:
    class_map = load_class_map()
    just = f"{'x' * (LONGEST - 17)} leather armchair"
    assert class_map.classify(just).category == "armchair"
    assert class_map.classify(f"x{'x' * LONGEST} leather armchair").role == "unmapped"
    assert all(len(name) <= LONGEST for name in class_map._resolved)
