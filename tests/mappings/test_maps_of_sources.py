"""What mappings/README.md says of the maps of other sources, proved on files and real samples.

Their names lead into the class space of HM3D.
"""

from __future__ import annotations

import csv
from collections import Counter
from importlib.resources import files

import pytest
from conftest import REPOSITORY

from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import HOUSE as HOUSE_BOUND
from bsg_data.scene.class_map import ClassMap, load_class_map, published_maps
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.mp3d import _parse_house
from bsg_data.sources.procthor import name_asset
from bsg_data.sources.source import Source

SAMPLES = REPOSITORY.parent / "shared" / "sources"
HOUSE = SAMPLES / "17DRP5sb8fy.house.gz"
HM3D = load_class_map("hm3d45-v2")
BEHAVIOR, MP3D, PROCTHOR = (
    load_class_map(f"{source}45-v1") for source in ("behavior", "mp3d", "procthor")
)
OTHERS = [row.class_map for row in published_maps().values() if row.source != "hm3d"]


@pytest.fixture(params=OTHERS)
def ours(request: pytest.FixtureRequest) -> ClassMap:
    """The map of one other source."""
    return load_class_map(request.param)


def test_a_category_that_hm3d_has_is_in_the_same_class_and_role(ours: ClassMap) -> None:
    for entry in ours.entries.values():
        listed = HM3D.lookup(entry.category)
        if listed is not None and listed.category == entry.category:
            assert listed.class_index == entry.class_index, entry
            structure = entry.category in ours.structure
            assert structure == (entry.category in HM3D.structure), entry


def test_one_category_has_one_class_and_structure_none(ours: ClassMap) -> None:
    classes = {(entry.category, entry.class_index) for entry in ours.entries.values()}
    assert len(classes) == len({category for category, _ in classes})
    assert {(name, None) for name in ours.structure} <= classes


@pytest.mark.parametrize(
    ("ours", "entries", "classified", "missing"),
    [
        (BEHAVIOR, 586, 254, "curtain,dresser"),
        (MP3D, 1659, 548, ""),
        (
            *(PROCTHOR, 223, 142),
            "bathtub,blanket,bookshelf,chandelier,clothes,dishwasher,fan,floor mat,mirror,"
            "nightstand,stove,wardrobe",
        ),
    ],
    ids=["behavior", "mp3d", "procthor"],
)
def test_what_the_readme_counts(
    ours: ClassMap, entries: int, classified: int, missing: str
) -> None:
    indices = [entry.class_index for entry in ours.entries.values()]
    assert (len(indices), sum(index is not None for index in indices)) == (entries, classified)
    absent = [name for index, name in enumerate(ours.classes) if index not in indices]
    assert ",".join(sorted(absent)) == missing


def test_a_name_of_matterport3d_that_hm3d_has_means_the_same() -> None:
    shared = {name: entry for name in MP3D.entries if (entry := HM3D.lookup(name)) is not None}
    assert len(shared) == 928
    assert {name: MP3D.entries[name] for name in shared} == shared
    roles = Counter(MP3D.classify(name).role for name in MP3D.entries)
    assert roles == {"classified": 548, "structure": 467, "left-out": 621, "nameless": 23}
    rows = files("bsg_mappings").joinpath("mp3d45-v1.structure.csv").read_text("utf-8").split("\n")
    assert rows[1:-1] == sorted(rows[1:-1])
    categories = {entry.category for entry in MP3D.entries.values()}
    assert MP3D.structure <= categories, "only what the map has"


# name → class of words that were decided by hand
BEHAVIOR_WORDS = {
    "straight_chair": "chair",
    "bottle_of_wine": "bottle",
    "box_of_cereal": "box",
    "carton_of_milk": "box",
    "can_of_soda": None,
    "frail": "basket",
    "low_resolution_tree": "plant",
    "shower_stall": "shower",
    "toilet_stall": None,
    "showerhead": "shower",
    "burner": "stove",
    "oven": None,
    "keyboard": None,
    "monitor": "computer",
    "washer": "washing machine",
    "clothes_dryer": "washing machine",
    "cap": None,
    "periodic_table": None,
    "oden_cooker": None,
    "wooden_spoon": None,
    "walls": None,
}
PROCTHOR_ASSETS = {
    "Side_Table_228_2_1": "table",
    "TV_Stand_206_2": "cabinet",
    "Wall_Decor_Photo_2V": "picture",
    "RoboTHOR_dining_table_antas": "table",
    "RoboTHOR_office_chair_sevnning": "chair",
    "bin_4": "garbage bin",
    "RoboTHOR_salt_pepper_shaker_bnyd_salt_v": None,
    "GarbageBag_21_2": "bag",
    "Dog_Bed_1_1": None,
    "Towel_Statue_3": None,
    "Cloth_1": None,
    "Toilet_Paper_Used_Up": None,
    "Bathroom_Faucet_7": None,
}
MP3D_WORDS = {
    "wall /otherroom": ("wall", None),
    "door / other room": ("door", None),
    "picture \\other room": ("picture", "picture"),
    "remove": ("unknown", None),
    "paingitn": ("painting", "picture"),
    "bed side table": ("bedside table", "nightstand"),
    "fireplace /w art": ("fireplace", None),
    "art / deer statue": ("statue", None),
    "wall behind stove": ("wall", None),
    "coffee table leg": ("coffee table leg", None),
    "television table": ("tv stand", "cabinet"),
    "dushbin": ("trash can", "garbage bin"),
}


def class_of(ours: ClassMap, name: str) -> str | None:
    index = ours.entries[name].class_index
    return None if index is None else ours.classes[index]


def test_words_that_were_decided() -> None:
    assert {name: class_of(BEHAVIOR, name) for name in BEHAVIOR_WORDS} == BEHAVIOR_WORDS
    assets = {name: class_of(PROCTHOR, name_asset(name)) for name in PROCTHOR_ASSETS}
    assert assets == PROCTHOR_ASSETS
    found = {name: (MP3D.entries[name].category, class_of(MP3D, name)) for name in MP3D_WORDS}
    assert found == MP3D_WORDS


def count_roles(source: Source, ours: ClassMap) -> Counter[str]:
    graphs = (source.read(ref, ours).graph for ref in source.find().scenes)
    return Counter(obj.role for graph in graphs for obj in graph.objects)


@pytest.mark.skipif(not SAMPLES.is_dir(), reason="needs ../shared/sources")
def test_coverage_of_real_samples() -> None:
    rooms = open_source("behavior", SAMPLES / "behavior_room_object_list.json")
    houses = open_source("procthor", SAMPLES / "procthor_150_houses.jsonl.gz")
    counts = {"classified": 22_392, "left-out": 10_026, "structure": 3_160}
    assert count_roles(rooms, BEHAVIOR) == counts
    counts = {"classified": 9_529, "left-out": 5_521, "structure": 226}
    assert count_roles(houses, PROCTHOR) == counts
    house = _parse_house(read_bytes(HOUSE, HOUSE_BOUND), path=HOUSE)
    with files("bsg_mappings").joinpath("mp3d45-v1.csv").open(encoding="utf-8") as file:
        listed = [row["raw_category"] for row in csv.DictReader(file)]
    assert sorted(house.categories) == listed
