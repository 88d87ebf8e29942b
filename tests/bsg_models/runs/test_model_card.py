"""A card says where its weights are from, under which terms, and is read back."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import read_fields
from bsg_models.runs.model_card import ModelCard, read_card, write_card
from bsg_models.runs.run_folder import TrainedOn

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
    text = write_card(card, fields=read_fields(run / "best.safetensors"))
    assert read_card(text, origin="card") == card
    matter = yaml.safe_load(text.split("---")[1])
    assert matter["license"] == front
    assert matter["library_name"] == "belief-scene-graphs"
    assert ("**The weights are for non-commercial research**" in text) == ("Ref" in licence)


def test_names_of_a_hostile_model_are_no_markup(run: Path) -> None:
    evil = "<b>`|[x](y)\n```\n# z"
    fields = read_fields(run / "best.safetensors")
    fields["class_space"]["name"] = evil
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
        fields=fields,
    )
    body = text.partition("\n---\n")[2]
    escaped = r"&lt;b&gt;\`\|\[x\](y) \`\`\` # z"
    command = "bsg-belief graph.json --model '<b>`|[x](y) ``` # z' --out belief.html"
    assert command in body.splitlines()
    plain = body.replace(command, "")
    assert plain.count(escaped) == 9
    assert "<b>" not in plain
    assert "javascript" not in plain
    assert "[x](y)" not in plain.replace(escaped, "")


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
