"""A model goes into a folder of the hub and comes back the same, without a network."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY

from bsg_models.errors import CheckpointError
from bsg_models.runs.found_model import download, find_model
from bsg_models.runs.hub import HubModel
from bsg_models.runs.model_card import read_card
from bsg_robot.graph.robot_json import read_robot_graph

OFFICE = REPOSITORY / "docs" / "office.json"


@pytest.mark.usefixtures("shipped")
def test_a_folder_of_the_hub_is_read_back(run: Path, tmp_path: Path) -> None:
    model = HubModel("other")
    folder = tmp_path / "hub"
    model.save_pretrained(folder)
    assert {p.name for p in folder.iterdir()} == {"model.safetensors", "config.json", "README.md"}
    again = HubModel.from_pretrained(folder)
    graph = read_robot_graph(OFFICE)
    np.testing.assert_array_equal(again.predictor(graph).presence, model.predictor(graph).presence)
    source = run / "best.safetensors"
    assert (folder / "model.safetensors").read_bytes() == source.read_bytes()
    card = read_card((folder / "README.md").read_text("utf-8"), origin="card")
    assert card.name == "other"
    config = json.loads((folder / "config.json").read_bytes())
    assert config["class_space"]["name"] == "hm3d45-v1"
    again.save_pretrained(tmp_path / "twice")  # what was read is what is written
    for path in folder.iterdir():
        assert (tmp_path / "twice" / path.name).read_bytes() == path.read_bytes()


def test_what_was_downloaded_is_found_and_nothing_else_is_asked_for(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import huggingface_hub

    asked = []

    def find(name: str, file: str, *, local_files_only: bool = False) -> str:
        asked.append((name, file, local_files_only))
        if file != "model.safetensors":
            raise huggingface_hub.errors.LocalEntryNotFoundError(file)
        return str(run / "best.safetensors")

    monkeypatch.setattr(huggingface_hub, "hf_hub_download", find)
    found = find_model("owner/rooms")
    assert (found.kind, found.name) == ("hub", "owner/rooms")
    assert asked == [("owner/rooms", "model.safetensors", True)]
    assert download("owner/rooms", local_files_only=True) == run / "best.safetensors"
    (run / "best.safetensors").write_bytes(b"damaged")
    with pytest.raises(CheckpointError, match="not a readable checkpoint"):
        download("owner/rooms", local_files_only=True)


def test_what_cannot_be_had_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CheckpointError, match="cannot be had from the hub"):
        download("owner/rooms", local_files_only=True, cache_dir=tmp_path)
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    with pytest.raises(CheckpointError, match=r"pip install '\.\[hub\]'"):
        download("owner/rooms")
