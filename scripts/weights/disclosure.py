"""Measure what a file of weights discloses about the buildings of its training.

`find_disclosed` checks, tensor by tensor, whether a row of a building can be read out of the file.
Their shapes are those of a new model: `restore_model` takes no others.
`measure_membership` attacks the model: it measures whether a training building can be told from
another. A model that memorises its training buildings assigns them a higher likelihood.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import concatenate
from bsg_models.inputs.folds import vocabulary_of
from bsg_models.runs.checkpoint import Checkpoint, load_checkpoint
from bsg_models.zoo.model import BeliefModel

_LONG_ID = 8  # letters of a scene id that no other text holds by chance
_FEW_CLASSES = 3  # a histogram of fewer classes identifies no room
_SAME = 1 - 1e-9  # cosine at which two rows count as one
_BATCH = 256  # buildings


@dataclass(frozen=True, slots=True)
class Disclosure:
    """What was looked for in a checkpoint, and what was found."""

    tensors: int  # number in the checkpoint
    numbers: int  # in all tensors
    categories: int  # of its vocabulary
    least_scenes: int  # number of training buildings with the rarest of these categories
    scenes: int  # of the dataset
    rooms: int  # of the dataset
    faults: tuple[str, ...]  # disclosures found; empty if there are none

    def __str__(self) -> str:
        """Return the result in words."""
        found = "; ".join(self.faults) or "none of these was found"
        read = (
            f" Each of the {self.categories:,} other categories that it reads occurs in "
            f"{self.least_scenes} training buildings or more."
            if self.categories
            else ""
        )
        return (
            f"The weights are {self.tensors} tensors with {self.numbers:,} numbers, in shapes that "
            "follow from settings, classes and vocabulary. They were searched for a row that is "
            f"the histogram of one of the {self.rooms:,} rooms or a multiple of it, and the header "
            f"for names of the {self.scenes} buildings. Result: {found}.{read}"
        )


def find_disclosed(path: Path, data: Dataset) -> Disclosure:
    """Look for buildings of a dataset in a checkpoint that was trained on it.

    Args:
        path: of the checkpoint.
        data: the dataset, split.
    """
    checkpoint = load_checkpoint(path)
    train = data.splits.get("train", data.scene_ids)
    rooms = sum(len(data.cells(scene)) - 1 for scene in data.scene_ids)
    least, rare = _rarest_category(checkpoint, data, train)
    return Disclosure(
        tensors=len(checkpoint.tensors),
        numbers=sum(tensor.size for tensor in checkpoint.tensors.values()),
        categories=len(checkpoint.header.vocabulary),
        least_scenes=least,
        scenes=len(data.scene_ids),
        rooms=rooms,
        faults=(*_copied_rows(checkpoint, data), *rare, *_named_scenes(checkpoint, data)),
    )


@dataclass(frozen=True, slots=True)
class Membership:
    """How well a training building can be told from a held-out one."""

    inside: float  # mean −log P of the hidden counts of a room, over training buildings, nats
    outside: float  # the same over held-out buildings
    # of the attack that takes the likelier building for a training building; 0.5 is guessing
    auc: float
    error: float  # standard error of `auc` if it were 0.5
    buildings: tuple[int, int]  # numbers of training buildings and held-out buildings

    def __str__(self) -> str:
        """Return the result in words."""
        return (
            f"A room of one of the {self.buildings[0]} training buildings surprises the model by "
            f"{self.inside:.2f} nats (mean −log P of its hidden counts, under masks as in "
            f"validation). A room of {self.buildings[1]} other buildings surprises it by "
            f"{self.outside:.2f} nats. An attacker who takes the less surprising of two buildings "
            f"for a training building is right in {self.auc:.0%} of the cases; guessing is right "
            f"in 50 % ± {self.error:.0%}."
        )


def measure_membership(
    model: BeliefModel, inside: MaskedBuildings, outside: MaskedBuildings
) -> Membership:
    """Attack a model by the likelihood that it assigns to buildings.

    The area under the curve is the Mann-Whitney statistic over pairs of buildings; a tie counts
    half.
    Its standard error without any difference is √((m + n + 1) / 12mn).

    Args:
        model: that is attacked.
        inside: training buildings under masks; each building counts once, whatever its draws.
        outside: other buildings under masks of the same recipe.
    """
    ours, theirs = _surprises(model, inside), _surprises(model, outside)
    m, n = len(ours), len(theirs)
    ranks = rankdata(np.concatenate([-ours, -theirs]))
    auc = (ranks[:m].sum() - m * (m + 1) / 2) / (m * n)
    return Membership(
        inside=float(ours.mean()),
        outside=float(theirs.mean()),
        auc=float(auc),
        error=float(np.sqrt((m + n + 1) / (12 * m * n))),
        buildings=(m, n),
    )


def _surprises(model: BeliefModel, masked: MaskedBuildings) -> Floats:
    """Return the mean −log P of a room of each building, over its rooms and draws, `[B]`."""
    beliefs = [model.expect(some.seen).hidden_counts for some in masked.batches(_BATCH)]
    counts = masked.hidden.astype(np.float64)
    nats = -concatenate(beliefs).log_probability(counts).sum(axis=1)
    rooms = ~masked.seen.is_building
    number = {scene: i for i, scene in enumerate(dict.fromkeys(masked.seen.scene_ids))}
    scenes = np.array([number[scene] for scene in masked.seen.scene_ids])
    building = scenes[masked.seen.building][rooms]
    totals = np.bincount(building, weights=nats[rooms], minlength=len(number))
    sizes = np.bincount(building, minlength=len(number))
    return np.asarray(totals[sizes > 0] / sizes[sizes > 0])


def _copied_rows(checkpoint: Checkpoint, data: Dataset) -> Iterator[str]:
    """Yield the tensors with a row that is proportional to the histogram of one room."""
    cells = np.concatenate([data.cells(scene) for scene in data.scene_ids]).astype(np.float64)
    rooms = cells[(cells > 0).sum(axis=1) >= _FEW_CLASSES]
    rooms /= np.linalg.norm(rooms, axis=1, keepdims=True)
    for name, tensor in checkpoint.tensors.items():
        if tensor.ndim < 2 or tensor.shape[-1] != cells.shape[1]:
            continue
        rows = tensor.astype(np.float64).reshape(-1, cells.shape[1])
        norms = np.linalg.norm(rows, axis=1, keepdims=True)
        rows = np.divide(rows, norms, out=np.zeros_like(rows), where=norms > 0)
        copied = int((rows @ rooms.T > _SAME).any(axis=1).sum()) if len(rooms) else 0
        if copied:
            yield f"{name} has {copied} rows that are the histogram of a room"


def _rarest_category(
    checkpoint: Checkpoint, data: Dataset, train: Sequence[str]
) -> tuple[int, list[str]]:
    """Return the number of training buildings with the rarest category, and faults of rare ones."""
    header = checkpoint.header
    configs = [header.config, *header.members.values()]
    wanted = max(config.data.min_scenes for config in configs)
    names = set(header.vocabulary)
    if not names:
        return 0, []
    times = dict.fromkeys(names, 0)
    for scene in train:
        for name in names & set(data.unclassified(scene).categories):
            times[name] += 1
    rare = sorted(names - set(vocabulary_of(data, train, min_scenes=wanted)))
    listed = ", ".join(map(repr, rare[:5]))
    faults = [f"{len(rare)} categories are in fewer than {wanted} training buildings: {listed}"]
    return min(times.values()), faults if rare else []


def _named_scenes(checkpoint: Checkpoint, data: Dataset) -> Iterator[str]:
    """Yield the buildings whose id or hash stands in the header; short ids only as whole words."""
    text = checkpoint.header.model_dump_json()
    for scene in data.scene_ids:
        for name in {scene, scene.partition("-")[2] or scene}:
            if (name in text) if len(name) >= _LONG_ID else (f'"{name}"' in text):
                yield f"its header names the building {name}"
