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
    "universal": "d28c0f04ed0a7bd3b3c2adfd18ec9513bc0f78bce967f443b55c9b8cbe9504c2",
    "universal-wide": "c283dec3024a0a299f6a474feab61333320ff5412103553811ef62056ab68ee3",
    "mixture": "e9f9738c1ce26b0eb0f8f0df8752091ebea3aefb094700108ee6ccd744e74f11",
    "ensemble": "ccc74cbe1d55cd8e0f2df22082908508bacfc9e35404aeed5f42510eb4c7208a",
    "open": "dbf06b712211200fd4d5bab84cfdbb674db6cda96af7f4368c737d5ceefd7590",
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
