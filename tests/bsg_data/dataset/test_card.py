"""The card and the Croissant description, read by the libraries that they are written for."""

from __future__ import annotations

import logging
from pathlib import Path

import mlcroissant
import pytest

from bsg_data.build import build_dataset
from bsg_data.dataset.card import write_card
from bsg_data.dataset.manifest import read_manifest
from bsg_data.sources.catalogue import open_source


@pytest.mark.filterwarnings("ignore")  # what mlcroissant uses of rdflib and pandas is deprecated
def test_mlcroissant_reads_every_record_set(
    dataset: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        found = mlcroissant.Dataset(jsonld=str(dataset / "croissant.json"))
    names = {record_set.id for record_set in found.metadata.record_sets}
    assert names == {
        *(f"records/{table}" for table in ("scenes", "rooms", "objects", "edges", "splits")),
        *(f"records/pairs/{split}" for split in ("train", "val", "test")),
    }
    scenes = list(found.records("records/scenes"))
    assert len(scenes) == 12
    pair = next(iter(found.records("records/pairs/val")))
    assert len(pair["pairs/val/input"]) == 45
    # Another test of the same process may have turned on mlcroissant's notes of each step.
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


@pytest.mark.filterwarnings("ignore")  # of what `datasets` uses
def test_hugging_face_loads_every_configuration(dataset: Path, tmp_path: Path) -> None:
    """The card's front matter is what `datasets` finds the files of a table by."""
    import datasets

    manifest = read_manifest(dataset)
    names = datasets.get_dataset_config_names(str(dataset))
    assert sorted(names) == ["edges", "objects", "pairs", "rooms", "scenes", "splits"]
    for name in names:
        loaded = datasets.load_dataset(str(dataset), name, cache_dir=str(tmp_path / "cache"))
        expected = {"train", "val", "test"} if name == "pairs" else {"full"}
        assert set(loaded) == expected
        rows = sum(sum(1 for _ in split) for split in loaded.values())
        assert rows == sum(entry.rows for entry in manifest.files_of(name))


@pytest.mark.filterwarnings("ignore")  # of what `datasets` uses
def test_another_dataset_in_a_folder_of_the_same_name_is_not_taken_for_the_first(
    tmp_path: Path,
) -> None:
    """Its cache is keyed by the card and the name of the folder; also after `build --force`."""
    import datasets

    found = []
    for where, thing in (("one", "bed"), ("two", "pillow"), ("two", "lamp")):
        table = tmp_path / where / "objects.csv"
        table.parent.mkdir(exist_ok=True)
        table.write_text(f"scene,room,category\nflat,bedroom,{thing}\n")
        build_dataset(open_source("table", table), table.parent / "dataset", force=True)
        cache = {"split": "train", "cache_dir": str(tmp_path / "cache")}
        rows = datasets.load_dataset(str(table.parent / "dataset"), "objects", **cache)
        found.append([row["raw_category"] for row in rows])
    assert found == [["bed"], ["pillow"], ["lamp"]]


def test_the_card_says_what_the_manifest_says(dataset: Path) -> None:
    card = (dataset / "README.md").read_text("utf-8")
    assert "12 buildings, 90 rooms" in card
    assert "license_name: matterport-academic" in card
    assert "Split by building: ratios 0.8 / 0.1 / 0.1, seed 0." in card
    assert "Pairs: 4 draws of the mask uniform, fraction 0.5, seed 0." in card


def test_names_of_a_hostile_manifest_are_no_markup(dataset: Path) -> None:
    evil = "<script>alert(1)</script>`|[x](y)"
    manifest = read_manifest(dataset)
    source = manifest.sources[0].model_copy(update={"kind": evil, "version": evil, "terms": None})
    space = manifest.class_space.model_copy(update={"name": evil})
    said = {"sources": (source,), "generator": evil, "class_space": space}
    card = write_card(manifest.model_copy(update=said))
    body = card.partition("\n---\n")[2]
    assert "&lt;script" in body
    assert "<script" not in body
    assert "](y)" not in body.replace("\\](y)", "")
