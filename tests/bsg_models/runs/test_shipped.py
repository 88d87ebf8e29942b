"""What is shipped is what was shipped: names, hashes, cards, and that each of them answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY

from bsg_data.scene.class_map import map_into
from bsg_data.seal import read_seal
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import read_fields
from bsg_models.runs.found_model import (
    find_shipped,
    read_shipped_card,
    shipped_names,
    weights_folder,
)
from bsg_models.runs.model_card import ModelCard, summarise_model, write_card
from bsg_models.runs.predictor import Predictor
from bsg_robot.graph.robot_json import read_robot_graph

# Weights never change under their name: a new training is a new line here.
PUBLISHED: dict[str, str] = {
    "universal": "5fa6b779e8e535896716a6ee07773e7be15e88759a002c47c766ce97c46a501d",
    "universal-wide": "0aa6506991d785d0c8fabd77d8bd205e60dd1cc09ba52402fa897d0571ae55a3",
    "mixture": "f9d1f736fa63d9227b245ae764585f10eaac6a5a27dbab87bd5f2fd4319cb02d",
    "ensemble": "31f2ffd09a31887c180933a8c7b61645bbe5d3546a8184e583317c685412ad6d",
    "open": "0d380ce5fd76fc686e691fefe8670b8da00bcbcb82a6cae908d0c34bf568bba6",
}


def test_published_weights_never_change_and_nothing_lies_beside_them() -> None:
    listed = read_seal(weights_folder()) or {}
    assert {name: listed[f"{name}.safetensors"] for name in shipped_names()} == PUBLISHED
    held = {
        path.name for path in weights_folder().iterdir() if path.suffix in (".md", ".safetensors")
    }
    assert held == set(listed)


@pytest.mark.parametrize("name", sorted(PUBLISHED))
def test_a_shipped_model_answers_and_has_a_card(name: str) -> None:
    predictor = Predictor(name)
    assert predictor.name == name
    office = REPOSITORY / "docs" / "office.json"
    graph = read_robot_graph(office, class_map=map_into(predictor.class_space.name))
    presence = predictor(graph).presence
    assert presence.shape == (4, len(predictor.classes))
    assert np.isfinite(presence).all()
    summary = summarise_model(name)
    assert summary.name == name
    assert summary.data.startswith(tuple("123456789"))
    assert summary.bytes < 30_000_000
    assert "building" in summary.card


def test_a_changed_model_is_refused(shipped: Path) -> None:
    whole = (shipped / "other.safetensors").read_bytes()
    (shipped / "other.safetensors").write_bytes(whole[:-1])
    with pytest.raises(CheckpointError, match="train or install again"):
        Predictor("other")
    assert Predictor().name == "universal"  # the default is another file


@pytest.mark.parametrize("name", sorted(PUBLISHED))
def test_the_facts_of_a_card_are_those_of_its_checkpoint(name: str) -> None:
    """The part of a card that follows from the checkpoint is what the program would write now."""
    fields = read_fields(find_shipped(name))
    written = write_card(ModelCard(name=name, purpose=""), fields=fields)
    facts = written.split("## Facts\n")[1].split("\n## ")[0]
    assert read_shipped_card(name).split("## Facts\n")[1].split("\n## ")[0] == facts
    assert ("| best epoch | " in facts) == (fields["epoch"] > 0)
