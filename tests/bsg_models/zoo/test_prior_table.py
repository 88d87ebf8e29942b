"""Tables of common sense: how they are read, refused and used."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from one_building import observe_building
from scipy.special import logit

from bsg_data.scene.class_space import load_class_space
from bsg_data.scene.surroundings import Surroundings
from bsg_models.errors import ConfigError
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.prior_table import PriorTableConfig, PriorTableModel, read_prior_table

NAMES = ("bed", "stove", "lamp")
ROOMS = {
    "bedroom": {"weight": 3, "presence": {"bed": 0.9, "lamp": 0.8}},
    "kitchen": {"presence": {"stove": 0.95, "lamp": 0.4}},
}
TWICE = b'{"version": 1, "made_by": "us", "made_by": "them"}'
OBJECTS = {"bed": {"lamp": 0.8, "stove": 0.02}, "stove": {"lamp": 0.4}}


def write(folder: Path, **entries: Any) -> str:
    path = folder / "table.json"
    path.write_text(json.dumps({"version": 1, "made_by": "a test", **entries}), "utf-8")
    return str(path)


def make(path: str, *, temper: float = 1.0, trust: float = 0.9) -> PriorTableModel:
    config = PriorTableConfig(table=path, temper=temper, trust=trust)
    model = PriorTableModel(config, ModelInputs(classes=3))
    model.read_knowledge(NAMES)
    return model


@pytest.mark.parametrize("temper", [1.0, 0.5])
def test_the_type_of_a_room_is_bayes_rule_over_the_other_objects(
    tmp_path: Path, temper: float
) -> None:
    model = make(write(tmp_path, room_types=ROOMS, unlisted=0.1), temper=temper)
    seen = observe_building([[1, 0, 0]] * 3 + [[0, 0, 0]], hidden_share=[0.5, 0.5, 0.2, 1.0])
    found = model.score(seen)
    for row, looked in ((1, 0.5), (2, 0.8)):  # of the lamp: a bed is seen, and no stove
        bedroom = 0.75 * (0.9 * 0.9**looked) ** temper
        kitchen = 0.25 * (0.1 * 0.05**looked) ** temper
        lamp = (bedroom * 0.8 + kitchen * 0.4) / (bedroom + kitchen)
        assert found[row, 2] == pytest.approx(logit(lamp) - logit(0.75 * 0.8 + 0.25 * 0.4))
    bedroom, kitchen = 0.75 * 0.2 ** (0.5 * temper), 0.25 * 0.6 ** (0.5 * temper)
    bedroom, kitchen = bedroom * 0.9 ** (0.5 * temper), kitchen * 0.05 ** (0.5 * temper)
    bed = (bedroom * 0.9 + kitchen * 0.1) / (bedroom + kitchen)  # not by the bed itself
    assert found[1, 0] == pytest.approx(logit(bed) - logit(0.75 * 0.9 + 0.25 * 0.1))
    assert np.isnan(found[3]).all()


@pytest.mark.parametrize("trust", [1.0, 0.5])
def test_a_label_is_believed_where_nobody_looked(tmp_path: Path, trust: float) -> None:
    model = make(write(tmp_path, room_types=ROOMS, unlisted=0.1), trust=trust)
    labels = ["kitchen", "garage", None]  # the table does not list garages
    known = Surroundings.of_rooms([None] * 3, labels)
    found = model.score(
        replace(observe_building([[0, 0, 0]] * 4, hidden_share=1.0), surroundings=known)
    )
    stove = trust * 0.95 + (1 - trust) * (0.75 * 0.1 + 0.25 * 0.95)
    assert found[1, 1] == pytest.approx(logit(stove) - logit(0.75 * 0.1 + 0.25 * 0.95))
    assert np.isnan(found[2:]).all()


def test_objects_speak_in_the_mean_over_what_is_seen(tmp_path: Path) -> None:
    model = make(write(tmp_path, objects=OBJECTS))
    found = model.score(observe_building([[1, 1, 0]] * 2 + [[0, 1, 0], [0, 0, 4]]))
    usual = logit((0.8 + 0.4) / 2)
    assert found[1, 2] == pytest.approx((logit(0.8) + logit(0.4)) / 2 - usual)
    assert found[2, 2] == pytest.approx(logit(0.4) - usual)
    assert np.isnan(found[3]).all()  # the table has no row of what is seen


def test_both_parts_are_added(tmp_path: Path) -> None:
    seen = observe_building([[1, 0, 0]] * 2)
    parts = [
        make(write(tmp_path, **one)).score(seen)[1, 2]
        for one in (
            {"room_types": ROOMS},
            {"objects": OBJECTS},
            {"room_types": ROOMS, "objects": OBJECTS},
        )
    ]
    assert parts[2] == pytest.approx(parts[0] + parts[1])


@pytest.mark.parametrize(
    "entries",
    [
        {},
        {"room_types": {"kitchn": {"presence": {}}}},
        {"room_types": {"kitchen": {"presence": {"stov": 0.5}}}},
        {"objects": {"beds": {"bed": 0.5}}},
        {"objects": {"bed": {"zzqx": 0.5}}},
        {"objects": {"bed": {"lamp": 1.5}}},
        {"room_types": {"kitchen": {"weight": 0, "presence": {}}}},
        {"version": 2, "objects": OBJECTS},
    ],
)
def test_a_table_that_cannot_be_is_refused(tmp_path: Path, entries: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        read_prior_table(write(tmp_path, **entries), NAMES)


@pytest.mark.parametrize("content", [None, b"[]", b"\xff\xfe", b"[" * 5000, TWICE])
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "table.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError):
        read_prior_table(str(path), NAMES)


def test_a_table_without_end_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.json"
    with path.open("wb") as file:
        file.truncate(2**24 + 1)
    with pytest.raises(ConfigError):
        read_prior_table(str(path), NAMES)


def test_classes_of_another_space_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, objects={"bed": {"tableware": 0.5}, "tableware": {"bed": 0.5}})
    assert make(path).listed.tolist() == [True, False, False]


def test_the_hand_table_is_sound() -> None:
    classes = load_class_space().classes
    table = read_prior_table("", classes)
    assert "by hand" in table.made_by
    named = {name for room in table.room_types.values() for name in room.presence}
    assert named == set(classes)
    model = PriorTableModel(PriorTableConfig(), ModelInputs(classes=45))
    model.read_knowledge(classes)
    shown = np.zeros((2, 45), dtype=int)
    shown[1, [classes.index("stove"), classes.index("sink")]] = 1
    found = model.score(observe_building(shown.tolist()))[1]
    assert found[classes.index("refrigerator")] > 1 > -1 > found[classes.index("bed")]


@pytest.mark.parametrize("document", ["docs/prior-table.md", "mappings/prior-table-prompt.md"])
def test_the_tables_in_the_documents_are_tables(tmp_path: Path, document: str) -> None:
    text = (REPOSITORY / document).read_text("utf-8")
    shown = re.search(r"^\{\n.*?^\}$", text, re.DOTALL | re.MULTILINE)
    assert shown is not None
    path = tmp_path / "table.json"
    path.write_text(shown[0], "utf-8")
    table = read_prior_table(str(path), load_class_space().classes)
    assert table.room_types["bedroom"].presence["lamp"] == 0.9
