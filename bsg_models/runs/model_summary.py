"""Summarise any model, without torch: `bsg-models list` does not wait for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.bounds import CARD
from bsg_data.recipes import Record
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import read_fields
from bsg_models.runs.found_model import (
    DEFAULT_MODEL,
    HUB_CARD,
    FoundModel,
    Kind,
    find_model,
    find_shipped,
    read_shipped_card,
    shipped_names,
)
from bsg_models.runs.model_card import ModelCard, read_card, write_card


class ModelSummary(Record):
    """A model in short."""

    name: str  # by which it is found
    kind: Kind  # how it was found
    zoo_name: str  # of its configuration, as in the zoo
    class_space: str  # name of the space that it predicts
    class_space_sha256: str  # of the names of its classes
    classes: int  # number of classes
    dataset_sha256: str  # of the manifest of its training data
    config: dict[str, Any]  # of the run that trained it; newer settings are missing
    bytes: int  # of its checkpoint
    sha256: str  # of its checkpoint
    data: str  # its training data, in words
    licence: str  # of the weights
    purpose: str  # what it is for, in one line
    card: str  # full text of its card


def list_shipped() -> list[ModelSummary]:
    """Return the facts of every shipped model, in the listed order.

    Raises:
        CheckpointError: if a model was changed since it was shipped.
    """
    return [_summarise(FoundModel(find_shipped(n), n, "shipped")) for n in shipped_names()]


def summarise_model(model: AnyPath | FoundModel = DEFAULT_MODEL) -> ModelSummary:
    """Return the facts of a model, without loading its weights.

    Args:
        model: what `find_model` takes, or what it returned.

    Raises:
        CheckpointError: if there is no such model, or its header or card is damaged.
    """
    return _summarise(model if isinstance(model, FoundModel) else find_model(model))


def _summarise(found: FoundModel) -> ModelSummary:
    fields = read_fields(found.path)
    space, config = fields["class_space"], fields["config"]
    text = write_model_card(found, fields)
    card = read_card(text, origin=f"the card of {found.name}")
    return ModelSummary(
        name=found.name,
        kind=found.kind,
        zoo_name=config["name"],
        class_space=space["name"],
        class_space_sha256=space["sha256"],
        classes=len(space["classes"]),
        dataset_sha256=fields["dataset_sha256"],
        config=config,
        bytes=found.path.stat().st_size,
        sha256=hash_file(found.path),
        data=card.data,
        licence=card.licence,
        purpose=card.purpose,
        card=text,
    )


def write_model_card(found: FoundModel, fields: Mapping[str, Any]) -> str:
    """Return the card beside a model, or a card made from the header of its checkpoint."""
    beside = found.path.with_name(HUB_CARD)
    if found.kind == "shipped":
        return read_shipped_card(found.name)
    if found.kind in ("hub", "hub folder") and beside.is_file():
        return read_bytes(beside, CARD, error=CheckpointError).decode("utf-8", "replace")
    purpose = f"A trained {fields['config']['name']}."
    return write_card(ModelCard(name=found.name, purpose=purpose), fields=fields)
