"""Read and write configurations: everything that a run depends on besides its dataset.

A configuration is a zoo name or a TOML file; `--set training.epochs=50` overrides one value. An
error names the path of an unknown key, wrong type or impossible value, and the nearest valid key.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import (
    Field,
    SerializeAsAny,
    ValidationError,
    field_validator,
    model_validator,
)

from bsg_data.errors import RecipeError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.documents import parse_toml
from bsg_data.recipes import Exploration, MaskRecipe, Seed
from bsg_data.records import Record
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN, show_value
from bsg_models.errors import ConfigError
from bsg_models.zoo.catalogue import RECIPES, ZOO
from bsg_models.zoo.settings import DataConfig, ModelConfig, TrainingConfig

_MOST_FAULTS = 20  # that an error names


class RunConfig(Record):
    """The configuration of a run."""

    # Of the model, as in the zoo; by default the name of its family, the longest has 24 characters.
    name: str = Field(default="", max_length=1_000)
    seed: Seed = 0  # of all random draws
    model: SerializeAsAny[ModelConfig]  # settings of its family
    data: DataConfig = DataConfig()  # what it is trained on
    training: TrainingConfig = TrainingConfig()  # models fitted by counting ignore it

    def seed_of(self, epoch: int) -> int:
        """Return the seed of an epoch: of its order, and of its dropout."""
        import numpy as np  # names and settings are listed without it

        return int(np.random.SeedSequence([self.seed, epoch]).generate_state(1)[0])

    @property
    def members(self) -> tuple[str, ...]:
        """Names of the members of an ensemble; none of other models."""
        return getattr(self.model, "members", ())

    @property
    def reads_categories(self) -> bool:
        """Whether it reads visible objects outside the classes."""
        reads = "categories" in getattr(self.model, "reads", ())
        return reads or any(find_member(name).reads_categories for name in self.members)

    @property
    def is_by_seed(self) -> bool:
        """Whether another seed may train another model; an ensemble counts as such."""
        return bool(getattr(ZOO[self.model.family].make, "by_seed", True))

    @field_validator("name")
    @classmethod
    def _name_is_printable(cls, value: str) -> str:
        if not value.isprintable():
            raise ValueError(f"expected printable characters, found {show_value(value)}")
        return value

    @field_validator("model", mode="before")
    @classmethod
    def _read_family(cls, value: Any) -> ModelConfig:
        if isinstance(value, ModelConfig):
            return value
        family = value.get("family") if isinstance(value, Mapping) else value
        if not isinstance(family, str) or family not in ZOO:
            raise ValueError(
                f"model.family must be one of {', '.join(ZOO)}; found {show_value(family)}; if it "
                "is from another package, install that"
            )
        # Strict reading takes a tuple for a list in JSON only, and converts nothing else.
        return type(ZOO[family].config).model_validate_json(json.dumps(value), strict=True)  # noqa: TID251

    @model_validator(mode="after")
    def _take_name(self) -> RunConfig:
        if not self.name:
            object.__setattr__(self, "name", self.model.family)  # frozen, but not yet in use
        return self


def find_config(name: str) -> RunConfig:
    """Return the configuration of a name of the zoo or of `RECIPES`.

    Raises:
        ConfigError: for an unknown name; the message suggests the nearest.
    """
    model, settings = RECIPES.get(name, (name, {}))
    try:
        row = ZOO[model]
    except RecipeError as error:
        raise ConfigError(str(error)) from error
    training = row.training.model_copy(update=settings.get("training", {}))
    name = settings.get("name", model)
    return RunConfig(name=name, model=row.config, data=row.data, training=training)


def find_member(name: str) -> RunConfig:
    """Return the configuration of a member of an ensemble, which is none itself."""
    config = find_config(name)
    if config.members:
        raise ConfigError(f"{name} is an ensemble itself; name its members instead")
    return config


def read_config(path: AnyPath) -> dict[str, Any]:
    """Read a TOML file as nested tables.

    Raises:
        ConfigError: if it is missing or not TOML, with the line.
    """
    path = Path(path)
    try:
        return parse_toml(read_bytes(path, error=ConfigError))
    except ConfigError:
        raise
    except ValueError as error:
        raise ConfigError(f"{path}: not TOML ({error})") from error


def override(tables: Mapping[str, Any], settings: Sequence[str]) -> dict[str, Any]:
    """Return the tables with `path=value` settings applied; values are TOML, or bare text.

    Examples:
        >>> override({"seed": 0}, ["seed=3", "training.epochs=50", "data.masks=fixed"])
        {'seed': 3, 'training': {'epochs': 50}, 'data': {'masks': 'fixed'}}
    """
    result = copy.deepcopy(dict(tables))
    for setting in settings:
        path, equals, value = setting.partition("=")
        keys = path.strip().split(".")
        if not equals or not all(keys):
            raise ConfigError(
                f"--set {setting[:SHOWN]}: expected path=value, as in training.epochs=50"
            )
        table = result
        for key in keys[:-1]:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise ConfigError(
                    f"--set {setting[:SHOWN]}: {key[:SHOWN]} is a value and has no keys"
                )
        table[keys[-1]] = _parse_value(value.strip())
    return result


def validate_config(tables: Mapping[str, Any], *, source: str) -> RunConfig:
    """Return tables as a configuration.

    Raises:
        ConfigError: naming the first 20 faults: the path, the valid values, and the nearest key.
    """
    try:
        # Strict reading takes a tuple for a list in JSON only, and converts nothing else.
        return RunConfig.model_validate_json(json.dumps(tables, default=str), strict=True)  # noqa: TID251
    except RecursionError:
        raise ConfigError(f"{source}: nested too deep") from None
    except ValidationError as error:
        family = _family_of(tables)
        faults = [line for fault in error.errors() for line in _explain(fault, family=family)]
        if more := faults[_MOST_FAULTS:]:
            faults = [*faults[:_MOST_FAULTS], f"and {len(more):,} more"]
        raise ConfigError(f"{source}: " + "; ".join(faults)) from error


def write_toml(config: RunConfig) -> str:
    """Return a configuration as TOML that `read_config` reads; None values are left out."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))


def _family_of(tables: Mapping[str, Any]) -> type[ModelConfig]:
    """Return the settings of the family that tables name, or of all families if they name none."""
    model = tables.get("model")
    family = str(model.get("family")) if isinstance(model, Mapping) else ""
    return type(ZOO[family].config) if family in ZOO else ModelConfig


def _explain(
    fault: Any, *, family: type[ModelConfig], above: tuple[str | int, ...] = ()
) -> Iterator[str]:
    """Yield each fault with the path of its key and the valid values."""
    cause = fault.get("ctx", {}).get("error")
    path = (*above, *fault["loc"])
    if isinstance(cause, ValidationError):  # of a family's own settings
        for inner in cause.errors():
            yield from _explain(inner, family=family, above=path)
        return
    where = ".".join(str(part)[:SHOWN] for part in path) or "the configuration"
    if fault["type"] == "extra_forbidden":
        tables = {**_TABLES, "model": family}
        known = tuple(tables.get(str(path[-2]) if path[1:] else "", RunConfig).model_fields)
        hint = ask_if_meant(str(path[-1]), known) or f"valid are {', '.join(known)}"
        yield f"{where} is not a key; {hint}"
    elif fault["type"] == "value_error":  # of our own: it says what was found
        words = str(cause)
        yield words if words.startswith(f"{where}.") else f"{where}: {words}"
    else:
        yield f"{where}: {fault['msg'].lower()}, found {show_value(fault['input'])}"


_TABLES: Mapping[str, type[Record]] = {
    "data": DataConfig,
    "mask": MaskRecipe,
    "exploration": Exploration,
    "training": TrainingConfig,
}


def _parse_value(text: str) -> Any:
    try:
        return parse_toml(f"value = {text}")["value"]
    except ValueError:
        return text
