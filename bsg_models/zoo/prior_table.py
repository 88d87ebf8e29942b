"""Score classes by a table of common sense, written by a language model, a person or from a book.

The table is a JSON file (docs/prior-table.md) with one or both of:

    room_types    P(the room has class c | its type t), and how usual each type is
    objects       P(the room has class c | it has class j)

    score of c = logit P(c | what is known of the type) − logit P(c | any room)
                 + mean over visible j of (logit P(c | j) − logit of the mean of P(c | all j))

The type of a room comes from the observation, if the table lists it. The seen objects refine it, or
replace it if it is missing, by Bayes' rule over the types. The rule uses the table's P(j | t) for
each other class, seen or absent, weighted by how far the room was looked into. It is tempered,
because objects are not independent. The table is read when the model is fitted; the checkpoint then
holds it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
from pydantic import Field, ValidationError, model_validator
from scipy.special import logit, logsumexp

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.errors import ClassMapError
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import PRIOR
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.observation import Observation
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_space import list_class_spaces, load_class_space, read_published
from bsg_data.scene.room_label import list_room_labels
from bsg_data.spelling import SHOWN, ask_if_meant
from bsg_models.errors import ConfigError
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import ModelInputs, to_array
from bsg_models.zoo.presence_odds import PresenceOdds, average_others
from bsg_models.zoo.settings import ModelConfig
from bsg_models.zoo.training_recipes import VARIED

HAND_TABLE = "hand-prior-v1.json"
_LEAST = 0.01  # no class is certainly absent from, or certainly in, a room

Probability = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class RoomTypePrior(Record):
    """What a type of room has.

    Attributes:
        weight: how usual the type is; only ratios count.
        presence: class → P(such a room has at least one).
    """

    weight: float = Field(default=1.0, gt=0, le=1e6, allow_inf_nan=False)
    presence: dict[str, Probability]


class PriorTable(Record):
    """A table of common sense, as in its JSON file.

    Attributes:
        version: of this format.
        made_by: who or what made it, and how.
        unlisted: probability of a class that a type, or an object, does not name.
        room_types: room label → what such a room has.
        objects: class j → class c → P(a room that has j has c).
    """

    version: Literal[1]
    made_by: str = Field(min_length=1, max_length=10_000)
    unlisted: Probability = 0.02
    room_types: dict[str, RoomTypePrior] = Field(default_factory=dict)
    objects: dict[str, dict[str, Probability]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _says_something(self) -> PriorTable:
        if not self.room_types and not self.objects:
            raise ValueError("expected room_types, objects or both, found neither")
        return self


class PriorTableConfig(ModelConfig):
    """Presence of each class by a table that a language model or a person wrote.

    Attributes:
        table: path of its JSON; empty for the shipped one, which we wrote by hand.
        temper: exponent on the evidence of each object about the type of its room.
        trust: probability that a room's label is right; otherwise it counts as unlabelled.
    """

    family: Literal["prior-table"] = "prior-table"
    table: str = ""
    temper: float = Field(default=0.5, gt=0, le=1)
    trust: float = Field(default=0.9, ge=0, le=1)


class PriorTableModel(PresenceOdds):
    """A score from a table of common sense.

    Attributes:
        of_type: `[L, C]` P(c | type), L the common room labels.
        weight: `[L]` how usual a type is, 0 if it is not listed.
        of_object: `[C, C]` P(column | row).
        listed: `[C]` whether the table has the row.
    """

    of_type: torch.Tensor
    weight: torch.Tensor
    of_object: torch.Tensor
    listed: torch.Tensor

    config: PriorTableConfig

    def __init__(self, config: PriorTableConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        labels, classes = len(list_room_labels()), inputs.classes
        self.register_buffer("of_type", torch.full((labels, classes), 0.5, dtype=torch.float64))
        self.register_buffer("weight", torch.zeros(labels, dtype=torch.float64))
        self.register_buffer("of_object", torch.full((classes, classes), 0.5, dtype=torch.float64))
        self.register_buffer("listed", torch.zeros(classes, dtype=torch.bool))

    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Read the table of the configuration."""
        table = read_prior_table(self.config.table, classes)
        place = {name: i for i, name in enumerate(classes)}
        labels = list_room_labels()
        of_type = np.full(self.of_type.shape, table.unlisted)
        weight, of_object = np.zeros(len(labels)), np.full(self.of_object.shape, table.unlisted)
        for label, prior in table.room_types.items():
            weight[labels.index(label)] = prior.weight
            _fill(of_type[labels.index(label)], prior.presence, place)
        for name, presence in table.objects.items():
            if name in place:
                _fill(of_object[place[name]], presence, place)
        self.of_type.copy_(torch.from_numpy(np.clip(of_type, _LEAST, 1 - _LEAST)))
        self.weight.copy_(torch.from_numpy(weight / max(weight.sum(), 1e-300)))
        self.of_object.copy_(torch.from_numpy(np.clip(of_object, _LEAST, 1 - _LEAST)))
        self.listed.copy_(torch.tensor([name in table.objects for name in classes]))

    def score(self, seen: Observation) -> Floats:
        """Return the sum of the scores of types and objects."""
        said = np.stack([self._score_types(seen), self._score_objects(seen)])
        silent = np.isnan(said).all(axis=0)
        return np.where(silent, np.nan, np.nan_to_num(said, nan=0.0).sum(axis=0))

    def _score_types(self, seen: Observation) -> Floats:
        """Return log odds given the room's type minus those of any room, `[N, C]`."""
        weight = to_array(self.weight)
        types = np.flatnonzero(weight)
        if not len(types):
            return np.full(seen.inputs.shape, np.nan)
        table, weight = to_array(self.of_type)[types], weight[types]
        told, known = self._told_types(seen, types)
        visible = seen.inputs > 0
        looked = np.where(visible, 0.0, 1 - seen.cell_share)
        log_here, log_gone = np.log(table), np.log1p(-table)
        total = visible @ log_here.T + looked @ log_gone.T
        scores = np.empty(seen.inputs.shape)
        for c in range(table.shape[1]):  # seen objects of the class itself do not count
            own = visible[:, [c]] * log_here[:, c] + looked[:, [c]] * log_gone[:, c]
            with np.errstate(divide="ignore"):
                log_type = np.log(told) + self.config.temper * (total - own)
            log_type -= logsumexp(log_type, axis=1, keepdims=True)
            scores[:, c] = logit(np.exp(log_type) @ table[:, c]) - logit(weight @ table[:, c])
        scores[~known & ~seen.looked_into] = np.nan
        return scores

    def _told_types(self, seen: Observation, types: Ints) -> tuple[Floats, Bools]:
        """Return P(type) before objects, `[N, T]`, and where the observation states the type."""
        weight = np.broadcast_to(to_array(self.weight)[types], (len(seen.inputs), len(types)))
        labels = seen.surroundings.labels[:, types].astype(np.float64)
        total = labels.sum(axis=1, keepdims=True)
        trust = np.where(total > 0, self.config.trust, 0.0)
        told = trust * labels / np.where(total > 0, total, 1.0) + (1 - trust) * weight
        return told, trust[:, 0] > 0

    def _score_objects(self, seen: Observation) -> Floats:
        """Return the mean score of the other visible classes, `[N, C]`."""
        listed, log_odds = to_array(self.listed) > 0, logit(to_array(self.of_object))
        if not listed.any():
            return np.full(seen.inputs.shape, np.nan)
        usual = logit(to_array(self.of_object)[listed].mean(axis=0))
        table = np.where(listed[:, None], log_odds - usual, np.nan)
        return average_others(seen.inputs > 0, table)


def read_prior_table(path: str, classes: tuple[str, ...]) -> PriorTable:
    """Read a table, and check that it names known rooms and classes.

    Args:
        path: of the JSON; empty for the shipped one.
        classes: `[C]` of the dataset. Classes of a published space that it lacks are allowed.

    Raises:
        ConfigError: naming the file, the entry, the fault, and the nearest name.
    """
    name, data = path or f"mappings/{HAND_TABLE}", _read_bytes(path)
    try:
        parse_json(data)  # refuses a repeated key
        table = PriorTable.model_validate_json(data, strict=True)
    except ConfigError as error:
        raise ConfigError(f"{name}: {error}; docs/prior-table.md has the format") from error
    except ValidationError as error:
        raise ConfigError(
            f"{name}: {name_fault(error)}; docs/prior-table.md has the format"
        ) from error
    except ValueError as error:
        raise ConfigError(
            f"{name}: is not JSON ({error}); docs/prior-table.md has the format"
        ) from error
    spaces = (load_class_space(space).classes for space in list_class_spaces())
    known = sorted({*classes, *(one for space in spaces for one in space)})
    named = {f"objects.{one}": one for one in table.objects}
    for where, presence in _presences(table):
        named |= {f"{where}.{one}": one for one in presence}
    for where, one in named.items():
        _require(one, known, where=f"{name}: {where}", what="class")
    for label in table.room_types:
        _require(label, list_room_labels(), where=f"{name}: room_types.{label}", what="room label")
    return table


def _presences(table: PriorTable) -> list[tuple[str, dict[str, float]]]:
    """Return the probabilities of classes, each with its place in the table."""
    rooms = [
        (f"room_types.{label}.presence", one.presence) for label, one in table.room_types.items()
    ]
    return rooms + [(f"objects.{one}", presence) for one, presence in table.objects.items()]


def _read_bytes(path: str) -> bytes:
    if not path:
        try:
            return read_published(HAND_TABLE)
        except ClassMapError as error:
            raise ConfigError(str(error)) from error
    return read_bytes(Path(path), PRIOR, error=_refuse)


def _refuse(said: str, **place: Any) -> ConfigError:
    return ConfigError(f"{said}; model.table is the path of a prior table", **place)


def _require(name: str, known: tuple[str, ...] | list[str], *, where: str, what: str) -> None:
    if name not in known:
        hint = ask_if_meant(name, known, most=3) or "docs/prior-table.md lists them"
        raise ConfigError(f"{where}: {name[:SHOWN]!r} is no {what}; {hint}")


def _fill(row: Floats, presence: dict[str, float], place: dict[str, int]) -> None:
    for name, probability in presence.items():
        if name in place:
            row[place[name]] = probability


PRIOR_TABLE = ZooRow(PriorTableConfig(), PriorTableModel, data=VARIED)
