"""TOML of a run, and what `--set` changes in it: `bsg_models.zoo.config`."""

from __future__ import annotations

from pathlib import Path

from bsg_models.zoo.config import find_config, override, read_config, validate_config, write_toml
from fuzz.target import Target, put

_MODELS = ("ceci-sage", "mixture", "ensemble", "gamma-poisson")


def seeds() -> dict[str, bytes]:
    """Return configurations of four families, and one with three settings after it."""
    made = {name: write_toml(find_config(name)).encode() for name in _MODELS}
    small = b'[model]\nfamily = "ceci-sage"\n'
    return {**made, "set": small + b"\0training.epochs=5\0model.width=16\0data.masks=fixed"}


def read(folder: Path, data: bytes) -> object:
    """Read a file, whose settings come after it, each behind a byte of 0."""
    text, *settings = data.split(b"\0")
    path = put(folder, ".toml", text)
    tables = override(read_config(path), [one.decode("utf-8", "replace") for one in settings])
    return validate_config(tables, source=str(path))


TARGET = Target(
    name="configuration",
    read=read,
    seeds=seeds,
    words=(
        *(
            "model.family='ceci-sage'",
            "training",
            "data.mask.fraction",
            "\0seed=",
            "1979-05-27",
            "nan",
        ),
        *("inf", "[[model]]", "[" * 40, "'''", '"""', "0xffff", "1e400", "{x={x=1}}", "=", "."),
    ),
    most=1_500,
)
