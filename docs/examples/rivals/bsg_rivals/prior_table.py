"""Score classes by a table of common sense, written by a language model, a person or from a book.

The table is a JSON file (docs/models.md) with one or both of:

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

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.observation.observation import Observation
from bsg_data.records import Keyed, SaidRecord, name_fault
from bsg_data.scene.class_space import list_class_spaces, load_class_space
from bsg_data.scene.room_label import list_room_labels
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN
from bsg_models.errors import ConfigError
from bsg_models.special_functions import log_sum_exp
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.hand_prior import HAND_TABLE
from bsg_models.zoo.layers import logit
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import ModelConfig
from bsg_rivals.presence_odds import ANY_FRACTION, PresenceOdds, average_others

_LEAST = 0.01  # no class is certainly absent from, or certainly in, a room

Probability = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class _RoomTypePrior(SaidRecord):
    """What a type of room has."""

    weight: float = Field(default=1.0, gt=0, le=1e6, allow_inf_nan=False)  # how usual; a ratio
    presence: Keyed[str, Probability]  # class → P(such a room has at least one)


class _PriorTable(SaidRecord):
    """A table of common sense, as in its JSON file."""

    version: Literal[1]
    made_by: str = Field(min_length=1, max_length=10_000)  # who or what, and how
    unlisted: Probability = 0.02  # of a class that a type, or an object, does not name
    room_types: Keyed[str, _RoomTypePrior] = Field(default_factory=dict)  # by room label
    # Class j → class c → P(a room that has j has c).
    objects: Keyed[str, Keyed[str, Probability]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _says_something(self) -> _PriorTable:
        if not self.room_types and not self.objects:
            raise ValueError("expected room_types, objects or both, found neither")
        return self

    def list_types(self, classes: Sequence[str]) -> tuple[Floats, Floats]:
        """Return P(c | type) `[L, C]` and how usual the type is `[L]`, 0 if it is not listed."""
        types, labels = self.room_types, list_room_labels()
        weight = np.array([types[one].weight if one in types else 0.0 for one in labels])
        said = {name: one.presence for name, one in types.items()}
        return self.list_presence(labels, said, classes), weight / max(weight.sum(), 1e-300)

    def list_presence(
        self,
        names: Sequence[str],
        said: Mapping[str, Mapping[str, float]],
        classes: Sequence[str],
    ) -> Floats:
        """Return what is said of the classes for each name, `[names, C]`."""
        rows = [[said.get(name, {}).get(one, self.unlisted) for one in classes] for name in names]
        return np.asarray(np.clip(rows, _LEAST, 1 - _LEAST))


class PriorTableConfig(ModelConfig):
    """Presence of each class by a table that a language model or a person wrote."""

    family: Literal["prior-table"] = "prior-table"
    table: str = ""  # path of its JSON; empty for the shipped one, which we wrote by hand
    # Exponent on the evidence of each object about the type of its room.
    temper: float = Field(default=0.5, gt=0, le=1)
    # Probability that a room's label is right; otherwise it counts as unlabelled.
    trust: float = Field(default=0.9, ge=0, le=1)


class PriorTableModel(PresenceOdds):
    """A score from a table of common sense."""

    of_type: Floats  # [L, C] P(c | type), L the common room labels
    weight: Floats  # [L] how usual a type is, 0 if it is not listed
    of_object: Floats  # [C, C] P(column | row)
    listed: Floats  # [C] whether the table has the row

    config: PriorTableConfig
    reads_labels = True

    def __init__(self, config: PriorTableConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        labels, classes = len(list_room_labels()), inputs.classes
        self.hold(
            of_type=np.full((labels, classes), 0.5),
            weight=np.zeros(labels),
            of_object=np.full((classes, classes), 0.5),
            listed=np.zeros(classes),
        )

    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Read the table of the configuration."""
        table = read_prior_table(self.config.table, classes)
        of_type, weight = table.list_types(classes)
        of_object = table.list_presence(classes, table.objects, classes)
        listed = [name in table.objects for name in classes]
        self.hold(of_type=of_type, weight=weight, of_object=of_object, listed=listed)

    def score(self, seen: Observation) -> Floats:
        """Return the sum of the scores of types and objects."""
        said = np.stack([self._score_types(seen), self._score_objects(seen)])
        silent = np.isnan(said).all(axis=0)
        return np.where(silent, np.nan, np.nan_to_num(said, nan=0.0).sum(axis=0))

    def _score_types(self, seen: Observation) -> Floats:
        """Return log odds given the room's type minus those of any room, `[N, C]`."""
        weight = self.weight
        types = np.flatnonzero(weight)
        if not len(types):
            return np.full(seen.inputs.shape, np.nan)
        table, weight = self.of_type[types], weight[types]
        prior, known = self._prior_of_types(seen, types)
        visible = seen.inputs > 0
        looked = np.where(visible, 0.0, 1 - seen.cell_share)
        log_here, log_gone = np.log(table), np.log1p(-table)
        total = visible @ log_here.T + looked @ log_gone.T
        scores = np.empty(seen.inputs.shape)
        for c in range(table.shape[1]):  # seen objects of the class itself do not count
            own = visible[:, [c]] * log_here[:, c] + looked[:, [c]] * log_gone[:, c]
            with np.errstate(divide="ignore"):
                log_type = np.log(prior) + self.config.temper * (total - own)
            log_type -= log_sum_exp(log_type, axis=1, keepdims=True)
            scores[:, c] = logit(np.exp(log_type) @ table[:, c]) - logit(weight @ table[:, c])
        scores[~known & ~seen.looked_into] = np.nan
        return scores

    def _prior_of_types(self, seen: Observation, types: Ints) -> tuple[Floats, Bools]:
        """Return P(type) before objects, `[N, T]`, and where the observation states the type."""
        weight = np.broadcast_to(self.weight[types], (len(seen.inputs), len(types)))
        labels = seen.surroundings.labels[:, types].astype(np.float64)
        total = labels.sum(axis=1, keepdims=True)
        trust = np.where(total > 0, self.config.trust, 0.0)
        prior = trust * labels / np.where(total > 0, total, 1.0) + (1 - trust) * weight
        return prior, trust[:, 0] > 0

    def _score_objects(self, seen: Observation) -> Floats:
        """Return the mean score of the other visible classes, `[N, C]`."""
        listed, log_odds = self.listed > 0, logit(self.of_object)
        if not listed.any():
            return np.full(seen.inputs.shape, np.nan)
        usual = logit(self.of_object[listed].mean(axis=0))
        table = np.where(listed[:, None], log_odds - usual, np.nan)
        return average_others(seen.inputs > 0, table)


def read_prior_table(path: str, classes: tuple[str, ...]) -> _PriorTable:
    """Read a table, the shipped one for no path; check that it names known rooms and classes.

    Classes of a published space that the dataset lacks are allowed. An error names the file, the
    entry, the fault, and the nearest name.
    """
    file = Path(path) if path else HAND_TABLE
    return _parse(read_bytes(file, error=ConfigError), str(file), classes)


def _parse(data: bytes, name: str, classes: tuple[str, ...]) -> _PriorTable:
    try:
        parse_json(data)  # refuses a repeated key
        table = _PriorTable.model_validate_json(data, strict=True)
        _require_known(table, classes)
    except (ConfigError, ValueError) as error:
        fault = name_fault(error) if isinstance(error, ValidationError) else str(error)
        raise ConfigError(f"{name}: {fault}; docs/models.md has the format") from error
    return table


def _require_known(table: _PriorTable, classes: tuple[str, ...]) -> None:
    spaces = (load_class_space(space).classes for space in list_class_spaces())
    known = sorted({*classes, *(one for space in spaces for one in space)})
    for label, prior in table.room_types.items():
        _require(label, list_room_labels(), what=f"room_types.{label}: room label")
        for one in prior.presence:
            _require(one, known, what=f"room_types.{label}.presence.{one}: class")
    for name, presence in table.objects.items():
        for one in (name, *presence):
            _require(one, known, what=f"objects.{name}.{one}: class")


def _require(name: str, known: Sequence[str], *, what: str) -> None:
    if name not in known:
        hint = ask_if_meant(name, known, most=3)
        raise ConfigError(f"{what} {name[:SHOWN]!r} is unknown" + (f"; {hint}" if hint else ""))


PRIOR_TABLE = ZooRow(PriorTableConfig(), PriorTableModel, data=ANY_FRACTION)
