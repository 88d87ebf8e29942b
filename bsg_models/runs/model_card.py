"""Write and read model cards: training data, terms, accuracy and limits; summarise any model.

No torch is needed: `bsg-models list` does not wait for it.

The front matter is what the Hugging Face hub reads. Its key `bsg` holds the facts that commands
show.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import yaml
from pydantic import ValidationError

from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.documents import parse_yaml
from bsg_data.records import Record, name_fault
from bsg_data.tables import escape_markdown, format_markdown, make_plain, mark_code
from bsg_data.terms import LICENCE_REF, is_address
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import read_fields
from bsg_models.runs.found_model import (
    DEFAULT_MODEL,
    HUB_CARD,
    FoundModel,
    Kind,
    find_model,
    read_shipped_card,
    shipped_names,
)
from bsg_models.runs.run_folder import UNKNOWN, TrainedOn, read_record
from bsg_models.zoo.settings import DataConfig

LIBRARY = "belief-scene-graphs"
PAPER = "https://arxiv.org/abs/2402.03840"
TAGS = ("belief-scene-graphs", "object-search", "robotics", "scene-graph")
_CANNOT = (
    "A presence is a probability, not an observation. Do not let a robot act on it where a mistake "
    "could hurt somebody.",
    "It knows the kinds of buildings that it was trained on. Its numbers mean little in a "
    "hospital, a factory or a ship, and may mean less in other regions of the world.",
    "It counts only objects of its classes. Other categories are at most evidence.",
    "It predicts what is in a room. It does not predict where in the room, and nothing about "
    "people.",
    "Its training buildings are public. Do not test it on them: it looks better there than it is.",
)


def _is_strict(licence: str) -> bool:
    """Say whether SPDX does not list a licence."""
    return licence.startswith(LICENCE_REF) or licence == UNKNOWN


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
        every = dict.fromkeys((source.licence, source.licence_url) for source in self.trained_on)
        strict = [terms for terms in every if _is_strict(terms[0])]
        return tuple(strict or every) or ((UNKNOWN, ""),)

    @property
    def is_restricted(self) -> bool:
        """Whether the weights have terms of their own, or unknown ones; not if SPDX lists them."""
        return any(_is_strict(name) for name, _ in self.licences)

    @property
    def licence(self) -> str:
        """The licences of the weights, as a phrase."""
        return ", ".join(name for name, _ in self.licences)

    @property
    def data(self) -> str:
        """The training data, as a phrase: `145 buildings of hm3d and 37 of behavior`."""
        parts = [f"{source.buildings} of {source.source}" for source in self.trained_on]
        if not parts:
            return "buildings that nobody named"
        parts[0] = parts[0].replace(" of", " buildings of", 1)
        return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))


def read_card(text: str, *, origin: str) -> ModelCard:
    """Return the facts of a card.

    Raises:
        CheckpointError: if the text is no card of a model.
    """
    try:
        _, front, _ = text.split("---\n", 2)
        return ModelCard.model_validate(parse_yaml(front.encode())["bsg"])
    except ValidationError as error:
        raise CheckpointError(f"{origin}: not a card of a model: {name_fault(error)}") from error
    except (ValueError, LookupError, TypeError) as error:
        raise CheckpointError(f"{origin}: not a card of a model: {error}") from error


def write_card(
    card: ModelCard,
    *,
    fields: Mapping[str, Any],
    accuracy: str = "",
    measured: Sequence[str] = (),
) -> str:
    """Return the card of a model: front matter for the hub, then Markdown.

    Args:
        card: its facts.
        fields: of the header of its checkpoint.
        accuracy: Markdown on how good the model is.
        measured: sentences on what the weights tell of their training data.
    """
    classes = len(fields["class_space"]["classes"])
    lines = [
        f"---\n{yaml.safe_dump(_front_matter(card), sort_keys=False, allow_unicode=True)}---",
        f"# {escape_markdown(card.name)}",
        "",
        f"{escape_markdown(card.purpose)} The model predicts what a robot has not seen of a "
        f"building: for every room, how many hidden objects of each of {classes} classes there "
        f"are, as probabilities. It is a model of Belief Scene Graphs "
        f"([paper]({PAPER})).",
        "",
        "```sh",
        f"bsg-belief graph.json --model {_quote(card.name)} --out belief.html",
        "```",
        "",
        "## Training data",
        "",
        *_describe_sources(card),
        "## Facts",
        "",
        *format_markdown(_list_facts(fields), header=("fact", "value")),
        "",
    ]
    if accuracy:
        lines += ["## Accuracy", "", accuracy, ""]
    if measured:
        lines += [
            "## Training data in the weights",
            "",
            *(f"{sentence}\n" for sentence in measured),
        ]
    lines += ["## Limits", "", *(f"- {sentence}" for sentence in _CANNOT), ""]
    return "\n".join(lines)


def _front_matter(card: ModelCard) -> dict[str, Any]:
    names = [name for name, _ in card.licences]
    listed = len(names) == 1 and not _is_strict(names[0])
    licence: dict[str, Any] = {"license": names[0].lower() if listed else "other"}
    if not listed:
        licence["license_name"] = ", ".join(name.removeprefix(LICENCE_REF) for name in names)
        links = [link for _, link in card.licences if link]
        licence |= {"license_link": links[0]} if links else {}
    return {
        **licence,
        "library_name": LIBRARY,
        "tags": list(TAGS),
        "bsg": card.model_dump(mode="json"),
    }


def _describe_sources(card: ModelCard) -> list[str]:
    if not card.trained_on:
        return [
            "The training data are not known. Ask whoever trained the model, also for the terms.",
            "",
        ]
    rows = [
        (
            escape_markdown(source.source),
            source.buildings,
            _link(source.licence, source.licence_url),
            escape_markdown(source.citation),
        )
        for source in card.trained_on
    ]
    table = format_markdown(rows, header=("source", "buildings", "licence", "citation"))
    lines = [*table, ""]
    lines += [
        f"{escape_markdown(source.source)}: {escape_markdown(source.sentence)}\n"
        for source in card.trained_on
        if source.sentence
    ]
    restricted = any(name.startswith(LICENCE_REF) for name, _ in card.licences)
    lines.append(
        "**The weights are for non-commercial research**, like the training data. The code is "
        "under Apache-2.0.\n"
        if restricted
        else f"The weights are under the terms of their sources: {escape_markdown(card.licence)}.\n"
    )
    return lines


def _link(text: str, address: str) -> str:
    """Return a link, or only the text if a card may not link to the address."""
    escaped = escape_markdown(text)
    return f"[{escaped}]({address})" if is_address(address) else escaped


def _quote(name: str) -> str:
    """Return a name quoted for a shell, on one line."""
    return shlex.quote(" ".join(make_plain(name).split()))


def _list_facts(fields: Mapping[str, Any]) -> list[tuple[str, str]]:
    config, space = fields["config"], fields["class_space"]
    facts = [
        ("model of the zoo", mark_code(config["name"])),
        ("class space", f"{mark_code(space['name'])}, {len(space['classes'])} classes"),
        ("sha256 of the classes", f"`{space['sha256']}`"),
        ("other categories that it reads", f"{len(fields['vocabulary']):,}"),
        ("training masks", str(DataConfig.model_validate(config["data"]).mask)),
        ("seed", str(config["seed"])),
        ("sha256 of the dataset", f"`{fields['dataset_sha256']}`"),
    ]
    if fields["epoch"]:
        facts.append(("best epoch", str(fields["best_epoch"])))
    return facts


class ModelSummary(Record):
    """A model in short."""

    name: str  # by which it is found
    kind: Kind  # how it was found
    zoo_name: str  # of its configuration, as in the zoo
    class_space: str  # name of the space that it predicts
    class_space_sha256: str  # of the names of its classes
    classes: int  # number of classes
    dataset_sha256: str  # of the manifest of its training data
    bytes: int  # of its checkpoint
    sha256: str  # of its checkpoint
    data: str  # its training data, in words
    licence: str  # of the weights
    purpose: str  # what it is for, in one line
    card: str  # full text of its card


def list_shipped() -> list[ModelSummary]:
    """Return the facts of every shipped model, in the listed order."""
    return [summarise_model(name) for name in shipped_names()]


def summarise_model(model: AnyPath = DEFAULT_MODEL) -> ModelSummary:
    """Return the facts of a model, as `find_model` finds it, without loading its weights.

    Raises:
        CheckpointError: if there is no such model, or its header or card is damaged.
    """
    found = find_model(model)
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
        return read_bytes(beside, error=CheckpointError).decode("utf-8", "replace")
    purpose = f"A trained {fields['config']['name']}."
    record = read_record(found.path.parent) if found.kind == "run" else None
    known = record.trained_on if record else ()
    return write_card(ModelCard(name=found.name, purpose=purpose, trained_on=known), fields=fields)
