"""Configurations: everything that a run depends on besides its dataset.

A run is named by a zoo name or a TOML file; `--set training.epochs=50` overrides one value. An
unknown key, a wrong type or an impossible value is named with its path and the nearest valid key.
"""

from __future__ import annotations

import difflib
import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

import tomli_w
from pydantic import Field, ValidationError, model_validator

from bsg_data.recipes import MaskRecipe, Record
from bsg_models.errors import ConfigError
from bsg_models.inputs.graphs import EdgeSet
from bsg_models.zoo.families import ModelConfig

Share = Annotated[float, Field(ge=0, le=1)]


class DataConfig(Record):
    """What a run is trained on.

    Attributes:
        masks: `fresh` draws new masks of the training buildings each epoch; `fixed` takes the
            stored pairs, as the paper does. Validation and test always take stored pairs.
        mask: of the fresh masks.
        fractions: from where to where the fraction of the fresh masks varies, instead of the
            mask's own: a model that met one fraction only is not to be trusted at another.
        edges: which edges the graphs have; see `bsg_models.inputs.graphs.connect`.
        min_scenes: training buildings in which a category outside the classes must occur to be
            read, by models that read them.
        withhold: share of the classes that training masks withhold. Above 0 they are those of a
            search: a random number of rooms was searched, and elsewhere no object of the withheld
            classes is shown. Models that read `withheld` are told.
        fold: the fold to test on, in a dataset of folds.
    """

    masks: Literal["fresh", "fixed"] = "fresh"
    mask: MaskRecipe = MaskRecipe()
    fractions: tuple[Share, Share] | None = None
    edges: tuple[EdgeSet, ...] = ("up", "down")
    min_scenes: int = Field(default=4, ge=1)
    withhold: Share = 0.0
    fold: int | None = Field(default=None, ge=0)

    @model_validator(mode="after")
    def _fractions_rise(self) -> Self:
        if self.fractions and self.fractions[0] > self.fractions[1]:
            raise ValueError(f"fractions must rise, found {list(self.fractions)}")
        return self

    @model_validator(mode="after")
    def _search_masks_are_fresh(self) -> Self:
        if self.withhold and (self.masks, self.mask.strategy) != ("fresh", "uniform"):
            raise ValueError("withhold needs fresh masks of the strategy uniform")
        return self


class TrainingConfig(Record):
    """How a network is trained; the paper's values are the defaults (section IV-A).

    Attributes:
        epochs: the paper's 5000.
        batch_size: graphs a step.
        learning_rate: of Adam.
        decay: the paper's "learning rate decay of 5e-6".
        decay_as: read as Adam's `weight-decay`, or as `learning-rate` / (1 + decay · step); or, not
            the paper's, `decoupled`: AdamW's, on matrices only.
        schedule: a `constant` learning rate, or `one-cycle`: a tenth of all steps up, then down to
            nothing as a cosine; `epochs` is then part of what is learned.
        clip: norm that gradients are cut to; None leaves them.
        validate_every: epochs between validations; each also writes the checkpoints.
    """

    epochs: int = Field(default=5000, ge=1)
    batch_size: int = Field(default=24, ge=1)
    learning_rate: float = Field(default=0.01, gt=0, allow_inf_nan=False)
    decay: float = Field(default=5e-6, ge=0, allow_inf_nan=False)
    decay_as: Literal["weight-decay", "learning-rate", "decoupled"] = "weight-decay"
    schedule: Literal["constant", "one-cycle"] = "constant"
    clip: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    validate_every: int = Field(default=10, ge=1)


class RunConfig(Record):
    """One run. `training` is not read by the models that are fitted by counting."""

    seed: int = Field(default=0, ge=0, lt=2**63)
    model: ModelConfig
    data: DataConfig = DataConfig()
    training: TrainingConfig = TrainingConfig()


def read_config(path: Path) -> dict[str, Any]:
    """Read a TOML file as nested tables.

    Raises:
        ConfigError: if it is missing or not TOML, with the line.
    """
    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML ({error})") from error


def override(tables: Mapping[str, Any], settings: Sequence[str]) -> dict[str, Any]:
    """Return the tables with `path=value` settings applied; values are TOML, or bare text.

    >>> override({"seed": 0}, ["seed=3", "training.epochs=50", "data.masks=fixed"])
    {'seed': 3, 'training': {'epochs': 50}, 'data': {'masks': 'fixed'}}
    """
    result = _copy(tables)
    for setting in settings:
        path, equals, value = setting.partition("=")
        keys = path.strip().split(".")
        if not equals or not all(keys):
            raise ConfigError(f"--set {setting}: expected path=value, as in training.epochs=50")
        table = result
        for key in keys[:-1]:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise ConfigError(f"--set {setting}: {key} is a value and has no keys")
        table[keys[-1]] = _parse_value(value.strip())
    return result


def validate_config(tables: Mapping[str, Any], *, source: str) -> RunConfig:
    """Return tables as a configuration.

    Raises:
        ConfigError: naming every fault with its path, what is valid, and the nearest key.
    """
    try:
        # As JSON, a list is a tuple and nothing else is taken for something that it is not.
        return RunConfig.model_validate_json(json.dumps(tables, default=str), strict=True)
    except ValidationError as error:
        faults = [_explain(fault) for fault in error.errors()]
        raise ConfigError(f"{source}: " + "; ".join(faults)) from error


def write_toml(config: RunConfig) -> str:
    """Return a configuration as TOML that `read_config` reads back; what is None is left out."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def valid_keys(path: Sequence[str | int]) -> tuple[str, ...]:
    """Return the keys that the table at `path` may have; a model's table is named by its family."""
    name = str(path[-1]) if path else ""
    return tuple(_TABLES.get(name, RunConfig).model_fields)


def _explain(fault: Any) -> str:
    path = list(fault["loc"])
    if len(path) > 1 and path[0] == "model" and path[1] in _FAMILIES:
        del path[1]  # pydantic's tag of the kind of model, which no key of the file names
    where = ".".join(str(part) for part in path) or "the configuration"
    if fault["type"] == "extra_forbidden":
        known = valid_keys(fault["loc"][:-1])
        near = difflib.get_close_matches(str(path[-1]), known, n=1)
        hint = f"did you mean {near[0]}?" if near else f"valid are {', '.join(known)}"
        return f"{where} is no key; {hint}"
    if fault["type"] in ("union_tag_invalid", "union_tag_not_found"):
        return f"{where}.family must be one of {', '.join(_FAMILIES)}"
    if fault["type"] == "value_error":  # of our own: it says what was found
        return f"{where}: {fault['ctx']['error']}"
    return f"{where}: {fault['msg'].lower()}, found {fault['input']!r}"


_FAMILIES: Mapping[str, type[Record]] = {
    config.model_fields["family"].default: config for config in get_args(get_args(ModelConfig)[0])
}
_TABLES: Mapping[str, type[Record]] = {
    **_FAMILIES,
    "data": DataConfig,
    "mask": MaskRecipe,
    "training": TrainingConfig,
}


def _parse_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _copy(tables: Mapping[str, Any]) -> dict[str, Any]:
    return {k: _copy(v) if isinstance(v, Mapping) else v for k, v in tables.items()}
