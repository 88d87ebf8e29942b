"""What mappings/README.md says of procthor45-v1, proved on the files and on real houses."""

from __future__ import annotations

from collections import Counter

import pytest
from conftest import REPOSITORY

from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.procthor import ProcTHORHouses, name_asset

SAMPLE = REPOSITORY.parent / "shared" / "sources" / "procthor_150_houses.jsonl.gz"
OURS, HM3D = load_class_map("procthor45-v1"), load_class_map("hm3d45-v2")


def test_what_the_readme_and_the_docs_count() -> None:
    assert len(OURS.entries) == 223
    assert sum(entry.class_index is not None for entry in OURS.entries.values()) == 142
    found = {entry.class_index for entry in OURS.entries.values()} - {None}
    missing = {name for index, name in enumerate(OURS.classes) if index not in found}
    words = (
        "bathtub,blanket,bookshelf,chandelier,clothes,dishwasher,fan,floor mat,mirror,nightstand,"
        "stove,wardrobe"
    )
    assert missing == set(words.split(","))


@pytest.mark.parametrize(
    ("asset", "class_name"),
    [
        ("Side_Table_228_2_1", "table"),
        ("TV_Stand_206_2", "cabinet"),
        ("Wall_Decor_Photo_2V", "picture"),
        ("RoboTHOR_dining_table_antas", "table"),
        ("RoboTHOR_office_chair_sevnning", "chair"),
        ("RoboTHOR_salt_pepper_shaker_bnyd_salt_v", None),
        ("bin_4", "garbage bin"),
        ("GarbageBag_21_2", "bag"),
        ("Dog_Bed_1_1", None),
        ("Towel_Statue_3", None),
        ("Cloth_1", None),
        ("Toilet_Paper_Used_Up", None),
        ("Bathroom_Faucet_7", None),
    ],
)
def test_assets_that_were_decided(asset: str, class_name: str | None) -> None:
    index = OURS.entries[name_asset(asset)].class_index
    assert (None if index is None else OURS.classes[index]) == class_name


@pytest.mark.skipif(not SAMPLE.is_file(), reason="needs ../shared/sources")
def test_coverage_of_real_houses() -> None:
    source = ProcTHORHouses(SAMPLE)
    graphs = [source.read(ref, OURS).graph for ref in source.find().scenes]
    roles = Counter(obj.role for graph in graphs for obj in graph.objects)
    assert roles == {"classified": 9_529, "left-out": 5_521, "structure": 226}
    found = {obj.class_index for graph in graphs for obj in graph.objects} - {None}
    assert len(found) == 30
