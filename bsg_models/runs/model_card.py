"""Write model cards, and summarise any model: training data, terms, accuracy and limits.

The front matter is what the Hugging Face hub reads. Its key `bsg` holds the facts that commands
show; `model_facts.py` reads them back.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.shards import read_table
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.bounds import CARD
from bsg_data.sources.source import LICENCE_REF, is_address
from bsg_data.tables import escape_markdown, format_markdown, make_plain, mark_code
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import CheckpointHeader, read_header
from bsg_models.runs.found_model import FoundModel, find_model
from bsg_models.runs.hub_files import HUB_CARD
from bsg_models.runs.model_facts import UNKNOWN, ModelCard, ModelSummary, TrainedOn, read_card
from bsg_models.runs.shipped import DEFAULT_MODEL, read_shipped_card

LIBRARY = "belief-scene-graphs"
PAPER = "https://arxiv.org/abs/2402.03840"
TAGS = ("belief-scene-graphs", "object-search", "robotics", "scene-graph")
_MEASURED = int | float | str | None
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


def describe_training(data: Dataset) -> tuple[TrainedOn, ...]:
    """Return the sources of a dataset, with the number of buildings of each."""
    table = read_table(data.path, "scenes", columns=["source"], manifest=data.manifest)
    numbers = Counter(table["source"].to_pylist())
    described = []
    for entry in {entry.kind: entry for entry in data.manifest.sources}.values():
        terms = entry.terms
        said = (
            {}
            if terms is None
            else {
                "licence": terms.licence,
                "licence_url": terms.licence_url,
                "sentence": terms.sentence,
                "citation": terms.citation,
            }
        )
        buildings = numbers[entry.kind]
        described.append(TrainedOn(source=entry.kind, buildings=buildings, **said))
    return tuple(described)


def write_card(
    card: ModelCard,
    *,
    header: CheckpointHeader,
    figures: Sequence[Mapping[str, _MEASURED]] = (),
    measured: Sequence[str] = (),
) -> str:
    """Return the card of a model: front matter for the hub, then Markdown.

    Args:
        card: its facts.
        header: of its checkpoint.
        figures: rows of a table of measured values, each with the same keys.
        measured: sentences on what the weights tell of their training data.
    """
    space = header.class_space
    lines = [
        f"---\n{yaml.safe_dump(_front_matter(card), sort_keys=False, allow_unicode=True)}---",
        f"# {escape_markdown(card.name)}",
        "",
        f"{escape_markdown(card.purpose)} The model predicts what a robot has not seen of a "
        f"building: for every room, how many hidden objects of each of {len(space.classes)} "
        f"classes there are, as probabilities. It is a model of Belief Scene Graphs "
        f"([paper]({PAPER})).",
        "",
        "```sh",
        f"bsg-belief graph.json --model {_quote(card.name)} --html belief.html",
        "```",
        "",
        "## Training data",
        "",
        *_describe_sources(card),
        "## Facts",
        "",
        *format_markdown(_list_facts(header), header=("fact", "value")),
        "",
    ]
    if figures:
        columns = tuple(figures[0])
        rows = [tuple(_show(row[name]) for name in columns) for row in figures]
        lines += ["## Accuracy", "", *format_markdown(rows, header=columns), ""]
    if measured:
        lines += ["## Training data in the weights", "", *(f"{one}\n" for one in measured)]
    lines += ["## Limits", "", *(f"- {sentence}" for sentence in _CANNOT), ""]
    return "\n".join(lines)


def card_text(found: FoundModel, header: CheckpointHeader) -> str:
    """Return the card beside a model, or a card made from its checkpoint."""
    beside = found.path.with_name(HUB_CARD)
    if found.kind == "shipped":
        return read_shipped_card(found.name)
    if found.kind in ("hub", "hub folder") and beside.is_file():
        data = read_bytes(beside, CARD, error=CheckpointError)
        return data.decode("utf-8", errors="replace")
    purpose = f"A trained {header.config.name}."
    return write_card(ModelCard(name=found.name, purpose=purpose), header=header)


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


def _front_matter(card: ModelCard) -> dict[str, Any]:
    names = [name for name, _ in card.licences]
    listed = len(names) == 1 and not names[0].startswith(LICENCE_REF) and names[0] != UNKNOWN
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
            escape_markdown(one.source),
            one.buildings,
            _link(one.licence, one.licence_url),
            escape_markdown(one.citation),
        )
        for one in card.trained_on
    ]
    table = format_markdown(rows, header=("source", "buildings", "licence", "citation"))
    lines = [*table, ""]
    lines += [
        f"{escape_markdown(one.source)}: {escape_markdown(one.sentence)}\n"
        for one in card.trained_on
        if one.sentence
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


def _list_facts(header: CheckpointHeader) -> list[tuple[str, str]]:
    config = header.config
    facts = [
        ("model of the zoo", mark_code(config.name)),
        (
            "class space",
            f"{mark_code(header.class_space.name)}, {len(header.class_space.classes)} classes",
        ),
        ("sha256 of the classes", f"`{header.class_space.sha256}`"),
        ("other categories that it reads", f"{len(header.vocabulary):,}"),
        ("training masks", str(config.data.fresh_mask)),
        ("seed", str(config.seed)),
        ("sha256 of the dataset", f"`{header.dataset_sha256}`"),
    ]
    if header.epoch:
        facts.append(("best epoch", str(header.best_epoch)))
    return facts


def _show(value: _MEASURED) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
