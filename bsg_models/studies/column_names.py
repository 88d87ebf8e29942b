"""What the columns of a comparison are called: by models, and by folders only where it must be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from bsg_data.files import stem_of
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.found_model import FoundModel, name_model
from bsg_models.zoo.catalogue import BASELINES


def name_runs(runs: Sequence[tuple[FoundModel, CheckpointHeader]]) -> tuple[str, ...]:
    """Return a name for each run: its model's, as `ceci-gcn`.

    Runs of one model, and a run of a baseline's model, have their folder in it, too, as
    `ceci-gcn (second)`. Where that is still taken, a number follows.
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

    Two names of which files would be called the same count as one.

    >>> first_free("mine", ["mine", "mine-2"])
    'mine-3'
    """
    stems = {stem_of(one) for one in taken}
    free, number = name, 2
    while stem_of(free) in stems:
        free, number = f"{name}-{number}", number + 1
    return free
