"""A card says where its weights are from, under which terms, and is read back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import RecipeError
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.disclosure import Membership
from bsg_models.runs.found_model import find_model
from bsg_models.runs.model_card import card_text, describe_training, read_figures, write_card
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
        membership=Membership(inside=20.0, outside=21.5, auc=0.62, error=0.05, buildings=(9, 3)),
    )
    assert "| uniform | 0.912 | – |" in text
    assert "is right in 62% of the cases" in text
    assert "`hm3d45-v2`, 45 classes" in text


def test_the_sources_of_a_dataset_are_those_of_the_model(dataset: Path) -> None:
    (only,) = describe_training(Dataset.open(dataset))
    assert (only.source, only.buildings) == ("hm3d", 12)
    assert only.licence == "LicenseRef-matterport-academic"


def test_a_run_has_a_card_that_says_what_nobody_knows(run: Path) -> None:
    text = card_text(find_model(run), read_header(run / "best.safetensors"))
    assert "Ask whoever trained the model" in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "front matter"),
        ("---\nlicense: mit\n", "front matter"),
        ("---\nlicense: mit\n---\n", "has no `bsg`"),
        ("---\nbsg: {name: a}\n---\n", "purpose: Field required"),
        ("---\nbsg: &a [*a]\n---\n", "alias"),
        (
            "---\nbsg: {name: a, purpose: b, trained_on: [{source: x, buildings: -1}]}\n---\n",
            "greater",
        ),
        ("---\n" + "x" * 1_000_001 + "\n---\n", "front matter"),
    ],
)
def test_what_is_no_card_is_refused(text: str, words: str) -> None:
    with pytest.raises(CheckpointError, match=words):
        read_card(text, origin="somewhere.md")


@pytest.mark.parametrize(
    "said", ["{", "[]", '{"a": 1}', '{"a": [{"x": 1}, {"y": 1}]}', '{"a": [1]}']
)
def test_figures_that_are_no_table_are_refused(said: str, tmp_path: Path) -> None:
    (tmp_path / "figures.json").write_text(said)
    with pytest.raises(RecipeError, match=r"figures\.json"):
        read_figures(tmp_path / "figures.json")
    rows = {"a": [{"x": 1, "y": None}]}
    (tmp_path / "figures.json").write_text(json.dumps(rows))
    assert read_figures(tmp_path / "figures.json") == rows
