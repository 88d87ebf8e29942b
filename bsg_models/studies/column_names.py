"""Name the columns of a comparison: by model, and by folder only if two names would be equal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from bsg_data.files import stem_of
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.found_model import FoundModel, name_model
from bsg_models.zoo.catalogue import BASELINES


def name_runs(runs: Sequence[tuple[FoundModel, CheckpointHeader]]) -> tuple[str, ...]:
    """Return a name for each run: its model's, such as `ceci-gcn`.

    Runs of one model, and a run whose model is also a baseline, get their folder as well:
    `ceci-gcn (second)`. If that name is taken too, a number follows.
    """
    models = [name_model(found, header) for found, header in runs]
    times = Counter([*models, *BASELINES])
    names: list[str] = []
    for model, (found, _) in zip(models, runs, strict=True):
        name = model if times[model] == 1 else f"{model} ({found.name})"
        names.append(first_free(name, names))
    return tuple(names)


def first_free(name: str, taken: Collection[str]) -> str:
    """Return a name, or the first of `name-2`, `name-3` … that is not taken.

    Two names count as equal if files named after them would have the same name.

    >>> first_free("mine", ["mine", "mine-2"])
    'mine-3'
    """
    stems = {stem_of(one) for one in taken}
    free, number = name, 2
    while stem_of(free) in stems:
        free, number = f"{name}-{number}", number + 1
    return free
