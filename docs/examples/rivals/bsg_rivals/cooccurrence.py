"""Score classes by co-occurrence: which classes share rooms in another source.

A planner without a model asks what its objects usually stand beside. The table counts the 330 rooms
of BEHAVIOR-1K's list (MIT licence); `scripts/fit/cooccurrence.py` at commit 4227eff made it. A row
is two classes of `hm3d45-v1` that meet in rooms of at least three buildings; copied rooms count
each time. Two rules turn it into a score, with n rooms in all, n_c of which have the class c:

    pmi           the mean over visible classes j of log P(c | j) / P(c)
    naive-bayes   Σ_j visible log P(j | c) / P(j | not c)
                  + Σ_j absent (1 − f_j) log P(not j | c) / P(not j | not c)

P(c | j) = (n_cj + s P(c)) / (n_j + s), and so on. f_j is the share that the room hides of class j,
so an absent class counts as far as it was looked for. A pair without a row occurs in few buildings,
and counts as one room. Classes that the table does not list add nothing.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field

from bsg_data.arrays import Floats
from bsg_data.errors import ClassMapError
from bsg_data.observation.observation import Observation
from bsg_data.scene.class_space import read_rows
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import ModelConfig
from bsg_rivals.presence_odds import ANY_FRACTION, PresenceOdds, average_others

BEHAVIOR_TABLE = Path(__file__).with_name("behavior-cooccurrence-v1.csv")
_HEADER = ("class_a", "class_b", "rooms_with_both", "rooms_with_a", "rooms_with_b", "rooms")
_UNLISTED = 1.0  # rooms of a pair without a row


class CooccurrenceConfig(ModelConfig):
    """Co-occurrence of classes in BEHAVIOR's rooms: the mean over what is seen (PMI).

    Attributes:
        rule: how the table becomes a score.
        smoothing: s, average rooms that are added to every count.
    """

    family: Literal["cooccurrence"] = "cooccurrence"
    rule: Literal["pmi", "naive-bayes"] = "pmi"
    smoothing: float = Field(default=2.0, gt=0, allow_inf_nan=False)


class Cooccurrence(PresenceOdds):
    """A score from a table of co-occurrence.

    Attributes:
        together: `[C, C]` rooms with both classes; on the diagonal, rooms with the class, 0 if it
            is not listed.
        rooms: in all.
    """

    together: Floats
    rooms: Floats

    config: CooccurrenceConfig

    def __init__(self, config: CooccurrenceConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        shape = (inputs.classes, inputs.classes)
        self.hold(together=np.zeros(shape), rooms=1.0)

    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Read the published table."""
        data = BEHAVIOR_TABLE.read_bytes()
        together, rooms = read_table(BEHAVIOR_TABLE.name, data, classes)
        self.hold(together=together, rooms=rooms)

    def score(self, seen: Observation) -> Floats:
        """Return the scores of the rule."""
        together, rooms, s = self.together, float(self.rooms), self.config.smoothing
        number = together.diagonal()
        usual = (number + s / 2) / (rooms + s)
        given = (together + s * usual) / (number + s)[:, None]  # P(column | row)
        unlisted = (number == 0) | (number == 0)[:, None]
        if self.config.rule == "pmi":
            table = np.where(unlisted, np.nan, np.log(given / usual))
            return average_others(seen.inputs > 0, table)
        without = (number - together + s * usual) / (rooms - number + s)[:, None]
        quiet = unlisted | np.eye(len(number), dtype=bool)
        here = np.where(quiet, 0.0, np.log(given / without))
        gone = np.where(quiet, 0.0, np.log((1 - given) / (1 - without)))
        looked = np.where(seen.inputs > 0, 0.0, 1 - seen.cell_share)
        evidence = (seen.inputs > 0) @ here.T + looked @ gone.T
        heard = seen.looked_into[:, None] & (number > 0)
        return np.where(heard, evidence, np.nan)


def read_table(file: str, data: bytes, classes: tuple[str, ...]) -> tuple[Floats, float]:
    """Return the number of rooms with each two of some classes `[C, C]`, and of all rooms.

    Args:
        file: name of the table in errors.
        data: its bytes.
        classes: `[C]`; other classes of the table are left out.

    Raises:
        ClassMapError: naming the line at fault.
    """
    place = {name: i for i, name in enumerate(classes)}
    together = np.zeros((len(classes), len(classes)))
    rooms = 0
    for line, (a, b, *texts) in read_rows(file, data, _HEADER):
        try:
            both, with_a, with_b, rooms = (int(text) for text in texts)
        except ValueError as error:
            raise ClassMapError(f"{file}, line {line}: expected whole numbers of rooms") from error
        if not 0 < both <= min(with_a, with_b) or max(with_a, with_b) > rooms or a == b:
            raise ClassMapError(
                f"{file}, line {line}: expected two classes, and 0 < both ≤ each ≤ all rooms, "
                f"found {a}, {b}, {', '.join(texts)}"
            )
        for one, number in ((a, with_a), (b, with_b)):
            if one in place:
                together[place[one], place[one]] = number
        if a in place and b in place:
            together[place[a], place[b]] = together[place[b], place[a]] = both
    listed = together.diagonal() > 0
    unmet = listed & listed[:, None] & (together == 0)
    return np.where(unmet, _UNLISTED, together), float(max(rooms, 1))


COOCCURRENCE = ZooRow(CooccurrenceConfig(), Cooccurrence, data=ANY_FRACTION)
COOCCURRENCE_NAIVE_BAYES = ZooRow(
    CooccurrenceConfig(rule="naive-bayes"),
    Cooccurrence,
    data=ANY_FRACTION,
    summary="Co-occurrence of classes in BEHAVIOR's rooms: naive Bayes over seen and absent ones.",
)
