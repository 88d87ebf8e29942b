"""A card says where its weights are from, under which terms, and is read back."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from bsg_data.dataset.dataset import Dataset
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.found_model import find_model
from bsg_models.runs.model_card import (
    card_text,
    describe_model,
    describe_training,
    summarise_model,
    write_card,
)
from bsg_models.runs.model_facts import ModelCard, TrainedOn, read_card

HM3D = TrainedOn(
    source="hm3d",
    buildings=145,
    licence="LicenseRef-matterport-academic",
    licence_url="https://matterport.example/terms",
    sentence="Under Matterport's terms: research.",
    citation="Yadav et al., 2023",
)
BEHAVIOR = TrainedOn(
    source="behavior", buildings=37, licence="MIT", licence_url="https://mit.example"
)


@pytest.mark.parametrize(
    ("trained_on", "licence", "front", "data"),
    [
        (
            (HM3D, BEHAVIOR),
            "LicenseRef-matterport-academic",
            "other",
            "145 buildings of hm3d and 37",
        ),
        ((BEHAVIOR,), "MIT", "mit", "37 buildings of behavior"),
        ((BEHAVIOR, TrainedOn(source="mine", buildings=3)), "unknown", "other", "and 3 of mine"),
        ((), "unknown", "other", "buildings that nobody named"),
    ],
)
def test_the_more_restrictive_terms_are_those_of_the_weights(
    run: Path, trained_on: tuple[TrainedOn, ...], licence: str, front: str, data: str
) -> None:
    card = ModelCard(name="rooms", purpose="For all.", trained_on=trained_on)
    assert card.licence == licence
    assert data in card.data
    text = write_card(card, header=read_header(run / "best.safetensors"))
    assert read_card(text, origin="card") == card
    said = yaml.safe_load(text.split("---")[1])
    assert said["license"] == front
    assert said["library_name"] == "belief-scene-graphs"
    assert ("**The weights are for non-commercial research**" in text) == ("Ref" in licence)


def test_names_of_a_hostile_model_are_no_markup(run: Path) -> None:
    evil = "<b>`|[x](y)\n```\n# z"
    header = read_header(run / "best.safetensors")
    space = header.class_space.model_copy(update={"name": evil})
    source = TrainedOn(
        source=evil,
        buildings=1,
        licence=evil,
        licence_url="javascript:alert(1)",
        sentence=evil,
        citation=evil,
    )
    text = write_card(
        ModelCard(name=evil, purpose=evil, trained_on=(source,)),
        header=header.model_copy(update={"class_space": space}),
    )
    body = text.partition("\n---\n")[2]
    escaped = r"&lt;b&gt;\`\|\[x\](y) \`\`\` # z"
    command = "bsg-belief graph.json --model '<b>`|[x](y) ``` # z' --html belief.html"
    assert command in body.splitlines()
    plain = body.replace(command, "")
    assert plain.count(escaped) == 9
    assert "<b>" not in plain
    assert "javascript" not in plain
    assert "[x](y)" not in plain.replace(escaped, "")


def test_a_card_has_figures_and_what_the_weights_tell(run: Path) -> None:
    card = ModelCard(name="rooms", purpose="For all.", trained_on=(HM3D,))
    text = write_card(
        card,
        header=read_header(run / "best.safetensors"),
        figures=[{"mask": "uniform", "AUROC": 0.91234, "beside": None}],
        measured=["An attacker is right in 62 % of the cases."],
    )
    assert "| uniform | 0.912 | – |" in text
    assert "right in 62 % of the cases" in text
    assert "`hm3d45-v2`, 45 classes" in text


def test_the_sources_of_a_dataset_are_those_of_the_model(dataset: Path) -> None:
    (only,) = describe_training(Dataset.open(dataset))
    assert (only.source, only.buildings) == ("hm3d", 12)
    assert only.licence == "LicenseRef-matterport-academic"


def test_a_run_has_a_card_that_says_what_nobody_knows(run: Path) -> None:
    text = card_text(find_model(run), read_header(run / "best.safetensors"))
    assert "Ask whoever trained the model" in text


@pytest.mark.parametrize(
    "text",
    [
        "",
        "---\nlicense: mit\n---\n",
        "---\nbsg: {name: a}\n---\n",
        "---\nbsg: &a [*a]\n---\n",
    ],
)
def test_what_is_no_card_is_refused(text: str) -> None:
    with pytest.raises(CheckpointError):
        read_card(text, origin="somewhere.md")


@pytest.mark.usefixtures("shipped")
def test_the_model_that_is_asked_is_said(run: Path) -> None:
    assert describe_model() == "universal (shipped; trained on 12 buildings of synthetic)"
    assert describe_model(run) == f"run (run, {run / 'best.safetensors'})"
    assert summarise_model(run).kind == "run"
    with pytest.raises(CheckpointError):
        describe_model(Path("none"))
