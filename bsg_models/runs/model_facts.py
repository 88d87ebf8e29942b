"""Read the facts of a model that need no torch: those of its card, and of all shipped models.

So `bsg-models list` does not wait for torch.
"""

from __future__ import annotations

from typing import Any

from pydantic import Field, ValidationError

from bsg_data.inputs.bounded_file import hash_file
from bsg_data.inputs.documents import parse_yaml
from bsg_data.recipes import Record, name_fault
from bsg_data.sources.source import LICENCE_REF
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import read_plain_header
from bsg_models.runs.shipped import Kind, find_shipped, read_shipped_card, shipped_names

UNKNOWN = "unknown"
_MOST_BYTES = 1_000_000


class TrainedOn(Record):
    """One source of a model's training data."""

    source: str  # its kind, e.g. `hm3d`.
    buildings: int = Field(ge=0)  # number used for training or validation
    licence: str = UNKNOWN  # SPDX, or `unknown`
    licence_url: str = ""  # link to the licence; empty if unknown
    sentence: str = ""  # what a user must know of the terms
    citation: str = ""  # of the source


class ModelCard(Record):
    """The facts of a card."""

    name: str  # of the model
    purpose: str  # what it is for, in one line
    trained_on: tuple[TrainedOn, ...] = ()  # the sources, in the order of the dataset

    @property
    def licences(self) -> tuple[tuple[str, str], ...]:
        """Licence and link of the weights: those of the most restrictive sources.

        Licences that SPDX does not list, and unknown terms, count as more restrictive.
        """
        every = dict.fromkeys((one.licence, one.licence_url) for one in self.trained_on)
        strict = [one for one in every if one[0].startswith(LICENCE_REF) or one[0] == UNKNOWN]
        return tuple(strict or every) or ((UNKNOWN, ""),)

    @property
    def is_restricted(self) -> bool:
        """Whether the weights have terms of their own, or unknown ones; not if SPDX lists them."""
        return any(name.startswith(LICENCE_REF) or name == UNKNOWN for name, _ in self.licences)

    @property
    def licence(self) -> str:
        """The licences of the weights, as a phrase."""
        return ", ".join(name for name, _ in self.licences)

    @property
    def data(self) -> str:
        """The training data, as a phrase: `145 buildings of hm3d and 37 of behavior`."""
        parts = [f"{one.buildings} of {one.source}" for one in self.trained_on]
        if not parts:
            return "buildings that nobody named"
        parts[0] = parts[0].replace(" of", " buildings of", 1)
        return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))


class ModelSummary(Record):
    """A model in short.

    Attributes:
        name: by which it is found.
        kind: how it was found.
        zoo_name: of its configuration, as in the zoo.
        class_space: name of the space that it predicts.
        class_space_sha256: of the names of its classes.
        classes: number of classes.
        dataset_sha256: of the manifest of its training data.
        config: of the run that trained it.
        bytes: of its checkpoint.
        sha256: of its checkpoint.
        data: its training data, in words.
        licence: of the weights.
        purpose: what it is for, in one line.
        card: full text of its card.
    """

    name: str
    kind: Kind
    zoo_name: str
    class_space: str
    class_space_sha256: str
    classes: int
    dataset_sha256: str
    config: dict[str, Any]
    bytes: int
    sha256: str
    data: str
    licence: str
    purpose: str
    card: str


def read_card(text: str, *, origin: str) -> ModelCard:
    """Return the facts of a card."""
    _, fence, rest = text.partition("---\n")
    front, end, _ = rest.partition("\n---")
    try:
        if not (fence and end) or len(text) > _MOST_BYTES:
            raise ValueError("expected front matter between two lines of ---")
        found = parse_yaml(front.encode())
        if not isinstance(found, dict) or not isinstance(found.get("bsg"), dict):
            raise ValueError("its front matter has no `bsg`")
        return ModelCard.model_validate(found["bsg"])
    except ValidationError as error:
        raise CheckpointError(f"{origin}: not a card of a model: {name_fault(error)}") from error
    except ValueError as error:
        raise CheckpointError(f"{origin}: not a card of a model: {error}") from error


def list_shipped() -> list[ModelSummary]:
    """Return the facts of every shipped model, in the listed order.

    A `config` is as the file holds it: settings that are newer than the file are missing.

    Raises:
        CheckpointError: if a model was changed since it was shipped.
    """
    return [_summarise(name) for name in shipped_names()]


def _summarise(name: str) -> ModelSummary:
    """Return what `summarise_model` returns; the hash of the file vouches for its header."""
    path, text = find_shipped(name), read_shipped_card(name)
    header, card = read_plain_header(path), read_card(text, origin=f"the card of {name}")
    space, config = header["class_space"], header["config"]
    return ModelSummary(
        name=name,
        kind="shipped",
        zoo_name=config["name"],
        class_space=space["name"],
        class_space_sha256=space["sha256"],
        classes=len(space["classes"]),
        dataset_sha256=header["dataset_sha256"],
        config=config,
        bytes=path.stat().st_size,
        sha256=hash_file(path),
        data=card.data,
        licence=card.licence,
        purpose=card.purpose,
        card=text,
    )
