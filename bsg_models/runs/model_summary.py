"""Summarise any model in a few facts, also for the line that names the model used."""

from __future__ import annotations

from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.found_model import FoundModel, find_model
from bsg_models.runs.model_card import card_text
from bsg_models.runs.model_facts import ModelSummary, read_card
from bsg_models.runs.shipped import DEFAULT_MODEL


def summarise_model(model: AnyPath | FoundModel = DEFAULT_MODEL) -> ModelSummary:
    """Return the facts of a model, without loading its weights.

    Args:
        model: what `find_model` takes, or what it returned.

    Raises:
        CheckpointError: if there is no such model, or its header or card is damaged.
    """
    found = model if isinstance(model, FoundModel) else find_model(model)
    header = read_header(found.path)
    text = card_text(found, header)
    card = read_card(text, origin=f"the card of {found.name}")
    return ModelSummary(
        name=found.name,
        kind=found.kind,
        zoo_name=header.config.name,
        class_space=header.class_space.name,
        class_space_sha256=header.class_space.sha256,
        classes=len(header.class_space.classes),
        dataset_sha256=header.dataset_sha256,
        config=header.config.model_dump(mode="json"),
        bytes=found.path.stat().st_size,
        sha256=hash_file(found.path),
        data=card.data,
        licence=card.licence,
        purpose=card.purpose,
        card=text,
    )


def describe_model(model: AnyPath = DEFAULT_MODEL) -> str:
    """Return which model is used: `universal (shipped; trained on 145 buildings of hm3d)`.

    Raises:
        CheckpointError: if there is no such model.
    """
    found = find_model(model)
    if found.kind == "shipped":
        return f"{found.name} (shipped; trained on {summarise_model(found).data})"
    return f"{found.name} ({found.kind}, {found.path})"
