"""Find the models that are installed with the program: weights, cards, and their hashes.

`weights/SHA256SUMS` lists the shipped files. A file whose hash differs is refused, as for class
maps.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Literal

from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.bounds import CHECKPOINT, CHECKSUMS
from bsg_data.inputs.documents import decode
from bsg_data.registry import require_known
from bsg_data.spelling import ask_if_meant
from bsg_models.errors import CheckpointError

DEFAULT_MODEL = "universal"
WIDE_MODEL = "universal-wide"  # answers for words for which the default model has no class
WIDE_MAP = "hm3d-wide-v1"
SUFFIX = ".safetensors"
SUMS = "SHA256SUMS"
Kind = Literal["run", "file", "hub folder", "shipped", "hub"]  # how a model was found
_LINE = re.compile(r"(?P<sha256>[0-9a-f]{64})  (?P<name>[a-z0-9][a-z0-9-]*\.(safetensors|md))")
_AGAIN = "install the package again"


def weights_folder() -> Path:
    """Return the folder of the package `bsg_weights`."""
    return Path(str(files("bsg_weights")))


def shipped_names() -> tuple[str, ...]:
    """Return the names of the shipped models, in the order of `SHA256SUMS`.

    Raises:
        CheckpointError: if the list is damaged.
    """
    listed = read_sums(weights_folder())
    return tuple(name.removesuffix(SUFFIX) for name in listed if name.endswith(SUFFIX))


def find_shipped(name: str) -> Path:
    """Return the checkpoint of a shipped model, after checking its hash."""
    _require_shipped(name)
    return _find_file(f"{name}{SUFFIX}")


def name_run(run: Path) -> str:
    """Return the name of a run for people: a shipped model's name, else the path."""
    shipped = run.parent == weights_folder() and run.suffix == SUFFIX
    return run.stem if shipped else str(run)


def find_name_of_shipped(path: Path) -> str | None:
    """Return which shipped model a checkpoint is, wherever it lies; None for any other."""
    sha256 = hash_file(path, CHECKPOINT)
    listed = read_sums(weights_folder()).items()
    return next((name.removesuffix(SUFFIX) for name, digest in listed if digest == sha256), None)


def read_shipped_card(name: str) -> str:
    """Return the card of a shipped model."""
    _require_shipped(name)
    return _find_file(f"{name}.md").read_text("utf-8")


def _require_shipped(name: str) -> None:
    """Refuse a name that no shipped model has."""
    names = shipped_names()
    if not names:
        raise CheckpointError(
            f"no model {name!r}: no models are shipped with this build; name the folder of a run "
            "of `bsg-train`"
        )
    require_known("shipped model", [name], names)


def describe_shipped() -> str:
    """Return which models are shipped, as the end of an error message."""
    names = shipped_names()
    if not names:
        return "no models are shipped with this build"
    return f"shipped models are {', '.join(names)}"


def suggest_shipped(name: str) -> str:
    """Return which models are shipped, with the name nearest to an unknown one."""
    return f"{ask_if_meant(name, shipped_names())} {describe_shipped()}".lstrip()


def read_sums(folder: Path) -> dict[str, str]:
    """Return file → sha256 of a folder of weights, in the listed order; empty without a list.

    It is parsed once as long as the file stays the same.
    """
    path = folder / SUMS
    if not path.is_file():
        return {}
    stat = path.stat()
    return _parse_sums(path, (stat.st_mtime_ns, stat.st_size))


@cache
def _parse_sums(path: Path, _changed: tuple[int, int]) -> dict[str, str]:
    try:
        lines = decode(read_bytes(path, CHECKSUMS, error=CheckpointError)).splitlines()
    except ValueError as error:
        raise CheckpointError(f"{path}: cannot be read ({error}); {_AGAIN}") from error
    sums: dict[str, str] = {}
    for number, line in enumerate(lines, 1):
        found = _LINE.fullmatch(line)
        if found is None:
            raise CheckpointError(
                f"{path}, line {number}: expected a sha256, two spaces and NAME.safetensors or "
                f"NAME.md, found {line[:120]!r}; {_AGAIN}"
            )
        sums[found["name"]] = found["sha256"]
    return sums


def encode_sums(folder: Path, names: tuple[str, ...]) -> str:
    """Return the text of `SHA256SUMS` for the models of a folder, each with its card."""
    files = [f"{name}{end}" for name in names for end in (SUFFIX, ".md")]
    return "".join(f"{hash_file(folder / file)}  {file}\n" for file in files)


def _find_file(name: str) -> Path:
    path = weights_folder() / name
    listed = read_sums(weights_folder()).get(name)
    if listed is None:
        raise CheckpointError(f"{path}: is not in {SUMS}; {_AGAIN}")
    try:
        found = hash_file(path)
    except OSError as error:
        raise CheckpointError(
            f"{path}: cannot be read ({error.strerror or error}); {_AGAIN}"
        ) from error
    if found != listed:
        raise CheckpointError(
            f"{path}: is not what was shipped (expected sha256 {listed[:12]}…, found "
            f"{found[:12]}…); {_AGAIN}"
        )
    return path
