"""Plan the runs of a leaderboard: which configuration is trained on which masks.

Each model is trained on every kind of mask of the leaderboard and measured on the same kind. A
configuration that names its own mask, such as `mixed`, is trained once, on that mask, and measured
on every kind.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from pydantic import field_validator

from bsg_data.observation.masks import MASKS
from bsg_data.recipes import MaskRecipe, Record
from bsg_models.errors import ConfigError
from bsg_models.training.training import member_config
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.ensemble import EnsembleConfig


class LeaderboardRecipe(Record):
    """Everything that a leaderboard depends on besides the dataset and the models."""

    # kinds of masks to measure on; a model without its own mask is trained on each
    masks: tuple[str, ...] = ("uniform", "rooms")
    fraction: float = 0.5  # share of the objects that they hide
    folds: int = 5  # number of folds; every building is tested on once
    draws: int = 5  # masks of every building
    seed: int = 0  # of the folds, the masks and the trainings
    resamples: int = 200  # number of bootstrap resamples of the buildings

    @field_validator("masks")
    @classmethod
    def _masks_exist(cls, masks: tuple[str, ...]) -> tuple[str, ...]:
        MASKS.require(masks)
        return masks


class Place(NamedTuple):
    """Where the runs of a model are, one per fold."""

    mask: str  # kind of mask that it is trained on
    name: str  # of the model


class Runs(NamedTuple):
    """All runs of a leaderboard, the same for every fold."""

    # place → configuration of each trained model, including members of ensembles
    single: dict[Place, RunConfig]
    ensembles: dict[Place, RunConfig]  # place → configuration of each ensemble
    # place of an ensemble → member → name of its run, trained on the same mask
    members: dict[Place, dict[str, str]]

    @property
    def masks(self) -> tuple[str, ...]:
        """Kinds of masks that are trained on."""
        return tuple(dict.fromkeys(place.mask for place in (*self.single, *self.ensembles)))


def plan_runs(models: Mapping[str, RunConfig], recipe: LeaderboardRecipe) -> Runs:
    """Return the runs that the models of a leaderboard need; models share equal runs.

    An ensemble reuses a run of the leaderboard if its configuration is the one it needs. Otherwise
    the member is trained once more, as `ENSEMBLE+MEMBER`.
    """
    runs = Runs({}, {}, {})
    placed = {
        Place(trained_on(config, mask), name): config
        for mask in recipe.masks
        for name, config in models.items()
    }
    for place, config in placed.items():
        some = runs.ensembles if _members_of(config) else runs.single
        some[place] = config
    for place, config in runs.ensembles.items():
        needed = {member: member_config(config, member) for member in _members_of(config)}
        runs.members[place] = {
            member: _plan_member(runs.single, place, member, own, recipe)
            for member, own in needed.items()
        }
    return runs


def _plan_member(
    single: dict[Place, RunConfig],
    ensemble: Place,
    member: str,
    needed: RunConfig,
    recipe: LeaderboardRecipe,
) -> str:
    """Plan the run of an ensemble's member unless it is planned; return its name."""
    mask, name = ensemble.mask, member
    for name in (member, f"{ensemble.name}+{member}"):
        planned = single.setdefault(Place(mask, name), needed)
        if _fit(planned, recipe, mask=mask) == _fit(needed, recipe, mask=mask):
            return name
    raise ConfigError(
        f"{name!r} is the name of a run that {ensemble.name} needs; rename this model"
    )


def trained_on(config: RunConfig, mask: str) -> str:
    """Return the kind of mask that a configuration trains on, to be measured on `mask`."""
    return config.data.own_strategy or mask


def _members_of(config: RunConfig) -> tuple[str, ...]:
    """Return the names of an ensemble's members; none for other models."""
    return config.model.members if isinstance(config.model, EnsembleConfig) else ()


def fit_to(config: RunConfig, recipe: LeaderboardRecipe, *, mask: str, fold: int) -> RunConfig:
    """Return a configuration for one kind of mask and one fold.

    The leaderboard's seed is added to its seeds. A mask that the configuration names is kept.
    """
    fitted = _fit(config, recipe, mask=mask)
    return fitted.model_copy(update={"data": fitted.data.model_copy(update={"fold": fold})})


def run_of(folder: Path, name: str, fold: int) -> Path:
    """Return the folder of a run below that of a mask."""
    return folder / f"fold-{fold}" / name


def _fit(config: RunConfig, recipe: LeaderboardRecipe, *, mask: str) -> RunConfig:
    """Return a configuration with the seeds and the mask of a leaderboard."""
    drawn = MaskRecipe(strategy=mask, fraction=recipe.fraction, seed=recipe.seed)
    if config.data.own_strategy:
        own = config.data.mask
        drawn = own.model_copy(update={"seed": own.seed + recipe.seed})
    return config.model_copy(
        update={"data": config.data.under(drawn), "seed": config.seed + recipe.seed}
    )
