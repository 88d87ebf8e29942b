"""Words for rooms: a list by hand, what it overrules, and every malformed one."""

from __future__ import annotations

import hashlib
import pickle
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.sources.room_words import WithRoomLabels
from bsg_data.sources.source import Source

WORDS = """\
source_label,label
Küche,kitchen
Diele,corridor
Office,living room
Archiv,
b,bedroom
B,bar
9,garage
Behandlung,examination room
"""


def write_rooms(folder: Path, words: str, *rooms: str) -> tuple[Source, Path]:
    """Write a building whose rooms 0, 1, ... have these names, and a list of words."""
    rows = [f"flat,{number},chair,{word}" for number, word in enumerate(rooms)]
    text = "\n".join(["scene,room,category,room_label", *rows])
    (folder / "objects.csv").write_text(text, "utf-8")
    (folder / "words.csv").write_text(words, "utf-8")
    return open_source("table", folder / "objects.csv"), folder / "words.csv"


def read_labels(source: Source) -> dict[str | None, str | None]:
    (ref,) = source.find().scenes
    rooms = source.read(ref, load_class_map()).graph.rooms
    return {room.source_label: room.label for room in rooms}


def test_a_listed_word_has_its_label_before_our_reading(tmp_path: Path) -> None:
    labels = {
        "Küche": "kitchen",
        "KÜCHE_2": "kitchen",  # in another spelling
        "Diele": "corridor",
        "Office": "living room",  # which we read as an office
        "Archiv": None,
        "b": "bedroom",
        "B": "bar",
        "Behandlung": "examination room",
        "bathroom": "bathroom",
        "Kajüte": None,
        "9": "garage",
        "7": None,  # a number that is listed stands for no other
    }
    table, words = write_rooms(tmp_path, WORDS, *labels)
    source = WithRoomLabels(table, words)
    assert read_labels(source) == labels
    assert read_labels(table)["Office"] == "office"
    assert [source.lists(word) for word in ("Archiv", "küche 3", "Kajüte")] == [True, True, False]


def test_the_file_is_recorded_and_read_once_and_words_of_layouts_count(tmp_path: Path) -> None:
    table, words = write_rooms(tmp_path, WORDS, "", "")
    (tmp_path / "labels.csv").write_text("scene,region,label\nflat,0,Diele\nflat,1,Kajüte\n")
    sha256 = hashlib.sha256(words.read_bytes()).hexdigest()
    source = WithRoomLabels(WithLayouts(table, tmp_path / "labels.csv"), words)
    words.unlink()
    source = pickle.loads(pickle.dumps(source))  # as a build sends it to its workers
    assert read_labels(source) == {"Diele": "corridor", "Kajüte": None}
    manifest = build_dataset(source, tmp_path / "out")
    options = {"room_labels": f"words.csv (sha256 {sha256})", "room_layouts": 1}
    assert (manifest.sources[0].kind, manifest.sources[0].options) == ("table", options)


@pytest.mark.parametrize(
    ("code", "line", "text"),
    [
        ("room-label-unknown", 2, "source_label,label\nKüche,kichen\n"),
        ("room-label-unknown", 2, "source_label,label\nKüche,Kitchen\n"),
        ("row-malformed", 2, "source_label,label\n,kitchen\n"),
        ("rows-disagree", 3, "source_label,label\nKüche,kitchen\nKüche,\n"),
        ("column-missing", None, "word,label\nKüche,kitchen\n"),
        ("column-twice", None, "source_label,label,label\n"),
    ],
)
def test_a_malformed_list_is_refused_with_its_line(
    tmp_path: Path, code: str, line: int | None, text: str
) -> None:
    table, words = write_rooms(tmp_path, text, "Küche")
    with refuses(SourceError, code, f"{words}, line {line}" if line else words):
        WithRoomLabels(table, words)
