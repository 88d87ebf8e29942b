"""Furniture: the shipped shares are made again, and one house is measured by hand."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import furniture
import pytest
import receptacle_shares
from conftest import REPOSITORY

SHARED = REPOSITORY.parent / "shared" / "housekeep" / "placements.csv"
PLACEMENTS = """object,split,room,receptacle,people_right,mean_rank,people_misplaced
milk,train,kitchen,fridge,9,1.0,0
milk,train,kitchen,table,1,2.0,9
yogurt,val,kitchen,fridge,8,1.0,0
yogurt,val,kitchen,table,2,1.0,8
"""


def describe_house() -> dict[str, object]:
    """Return a kitchen with a fridge, on which the milk lies, and a far table."""
    corners = [{"x": x, "y": 0, "z": z} for x, z in ((0, 0), (8, 0), (8, 8), (0, 8))]
    milk = {"id": "small|1|0|0", "assetId": "Milk_2", "position": {"x": 1, "y": 1, "z": 1}}
    fridge = {"id": "1|0", "assetId": "Fridge_1", "position": {"x": 1, "y": 0, "z": 1}}
    table = {"id": "1|1", "assetId": "Side_Table_228_2_1", "position": {"x": 8, "y": 0, "z": 8}}
    room = {"id": "room|1", "roomType": "Kitchen", "floorPolygon": corners}
    return {"rooms": [room], "doors": [], "objects": [fridge | {"children": [milk]}, table]}


def test_a_house_is_measured_by_hand(tmp_path: Path) -> None:
    (tmp_path / "placements.csv").write_text(PLACEMENTS, "utf-8")
    with gzip.open(tmp_path / "houses.jsonl.gz", "wt", encoding="utf-8") as file:
        file.write(json.dumps(describe_house()) + "\n")
    words = [f"--housekeep={tmp_path / 'placements.csv'}", "--resamples=2"]
    words += [f"--houses={tmp_path / 'houses.jsonl.gz'}", f"--out={tmp_path / 'out.json'}"]
    assert furniture.main(words) == 0
    tables = json.loads((tmp_path / "out.json").read_text("utf-8"))["furniture"]["tables"]
    by_people, _, lying, searches = (
        {row[0]: [cell.split()[0] for cell in row[1:]] for row in one["rows"]}
        for one in tables.values()
    )
    assert by_people["ours"][:2] == ["1.000", "1.000"], "the fridge comes first"
    assert lying["chance"][0] == "0.500"
    assert lying["ours"][0] == "1.000"
    ways = {name: float(row[0]) for name, row in searches.items()}
    # It comes in at the middle (4, 4), goes to the fridge, 3 √2 m away, and looks for 5 s.
    assert ways["`next_place`"] == pytest.approx(9.2)


@pytest.mark.skipif(not SHARED.is_file(), reason="needs ../shared")
def test_the_shipped_shares_are_made_of_the_answers(tmp_path: Path) -> None:
    made = tmp_path / "made.csv"
    assert receptacle_shares.main([f"--housekeep={SHARED}", f"--out={made}"]) == 0
    shipped = REPOSITORY / "mappings" / "receptacle-shares-v1.csv"
    assert made.read_bytes() == shipped.read_bytes()
