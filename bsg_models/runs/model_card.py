"""Write model cards: training data, terms, accuracy and limits of a model.

The front matter is what the Hugging Face hub reads. Its key `bsg` holds the facts that commands
show; `model_facts.py` reads them back.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.shards import read_table
from bsg_data.errors import RecipeError
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import CARD, RUN_RECORD
from bsg_data.inputs.documents import read_json
from bsg_data.sources.source import LICENCE_REF, is_address
from bsg_data.tables import escape_markdown, format_markdown, make_plain, mark_code
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.disclosure import Disclosure, Membership
from bsg_models.runs.found_model import FoundModel
from bsg_models.runs.hub_files import HUB_CARD
from bsg_models.runs.model_facts import UNKNOWN, ModelCard, TrainedOn
from bsg_models.runs.shipped import read_shipped_card

LIBRARY = "belief-scene-graphs"
PAPER = "https://arxiv.org/abs/2402.03840"
TAGS = ("belief-scene-graphs", "object-search", "robotics", "scene-graph")
_MEASURED = int | float | str | None
_CANNOT = (
    "A presence is a probability, not an observation. Do not let a robot act on it where a mistake "
    "could hurt somebody.",
    "It knows the kinds of buildings that it was trained on. Its numbers mean little in a "
    "hospital, a factory or a ship, and may mean less in other regions of the world.",
    "It was trained on whole buildings. In a graph of two or three rooms it may expect twice as "
    "many objects as there are in a room that nobody entered. Its presences are less affected.",
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
    disclosure: Disclosure | None = None,
    membership: Membership | None = None,
) -> str:
    """Return the card of a model: front matter for the hub, then Markdown.

    Args:
        card: its facts.
        header: of its checkpoint.
        figures: rows of a table of measured values, each with the same keys.
        disclosure: what was looked for in the weights.
        membership: how well a training building can be told from another.
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
    if disclosure is not None or membership is not None:
        lines += ["## Training data in the weights", ""]
        lines += [f"{sentence}\n" for sentence in (disclosure, membership) if sentence is not None]
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


def read_figures(path: Path) -> dict[str, list[dict[str, _MEASURED]]]:
    """Read tables of measured values: JSON, model → rows of the same keys."""
    found = read_json(path, RUN_RECORD, error=RecipeError)
    tables: dict[str, Any] = found if isinstance(found, dict) else {"the file": ""}
    for name, rows in tables.items():
        plain = isinstance(rows, list) and all(isinstance(row, dict) for row in rows)
        if not plain or len({tuple(row) for row in rows}) > 1:
            raise RecipeError(
                f"{path}: {name}: expected MODEL → a list of objects of the same keys"
            )
    return dict(tables)


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
