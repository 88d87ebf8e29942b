"""Keep the log of a run: time, seed, data and versions of each training, and how it ended.

Every training of a run, also a resumed one, adds two lines of JSON to `log.jsonl`:

    {"event": "begun", "time": "2026-11-22T15:04:05Z", "seed": 0, "epochs": 160, "from_epoch": 0, …}
    {"event": "ended", "time": "2026-11-22T15:09:44Z", "how": "finished", "epoch": 160, …}

A killed or running training has no second line. Logs of the same configuration on the same dataset
differ in `time` and `seconds` only.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from bsg_data.dataset.dataset import Dataset
from bsg_data.files import AnyPath, write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import RUN_RECORD
from bsg_data.recipes import Record, name_fault
from bsg_models.errors import TrainingError
from bsg_models.runs.checkpoint_file import read_fields
from bsg_models.runs.run_folder import CONFIG, LAST, LOG
from bsg_models.zoo.config import RunConfig, write_toml

_PACKAGES = ("belief-scene-graphs", "numpy", "torch", "torch-geometric")


class Begun(Record):
    """The start of a training."""

    event: Literal["begun"] = "begun"
    time: str  # UTC
    seed: int  # of all random draws
    epochs: int  # number asked for
    from_epoch: int  # epoch from which it continues; 0 for a fresh start
    dataset_sha256: str  # of the manifest of its dataset
    versions: dict[str, str]  # package → version; includes `python`


class Ended(Record):
    """The end of a training."""

    event: Literal["ended"] = "ended"
    time: str  # UTC
    how: Literal["finished", "stopped", "failed"]  # stopped from outside, e.g. by Ctrl-C
    epoch: int  # saved last; 0 for a model that is fitted by counting
    seconds: float  # since it began
    error: str | None = None  # why it failed
    notes: tuple[str, ...] = ()  # what it left out, such as rooms above a limit


_LINE: TypeAdapter[Begun | Ended] = TypeAdapter(
    Annotated[Begun | Ended, Field(discriminator="event")]
)


@contextmanager
def keep_log(run: Path, config: RunConfig, data: Dataset) -> Iterator[list[str]]:
    """Write a training's configuration into its run, and log the start and the end of the block.

    Yields:
        The notes of the training, a list that the block may extend.
    """
    began = time.perf_counter()
    versions = {name: version(name) for name in _PACKAGES} | {"python": platform.python_version()}
    begun = Begun(
        time=_now(),
        seed=config.seed,
        epochs=config.training.epochs,
        from_epoch=_last_epoch(run),
        dataset_sha256=data.sha256,
        versions=versions,
    )
    _add(run, begun)
    write_bytes(run / CONFIG, write_toml(config).encode())
    notes: list[str] = []

    def end(how: Literal["finished", "stopped", "failed"], error: str | None = None) -> None:
        seconds, epoch = round(time.perf_counter() - began, 3), _last_epoch(run)
        said = {"error": error, "notes": tuple(notes)}
        _add(run, Ended(time=_now(), how=how, epoch=epoch, seconds=seconds, **said))

    try:
        yield notes
    except (KeyboardInterrupt, GeneratorExit):
        end("stopped")
        raise
    except BaseException as error:
        end("failed", str(error) or repr(error))
        raise
    end("finished")


def read_log(run: AnyPath) -> tuple[Begun | Ended, ...]:
    """Return the entries of a run's log, the oldest first; empty for a run without a log.

    Raises:
        TrainingError: naming the faulty line.
    """
    path = Path(run) / LOG
    if not path.is_file():
        return ()
    lines = read_bytes(path, RUN_RECORD, error=TrainingError).splitlines()
    return tuple(_parse(line, where=f"{path}, line {n}") for n, line in enumerate(lines, 1))


def _parse(line: bytes, *, where: str) -> Begun | Ended:
    try:
        return _LINE.validate_json(line)
    except ValidationError as error:
        raise TrainingError(
            f"{where}: is not a line of a run's log ({name_fault(error)})"
        ) from error


def _add(run: Path, line: Begun | Ended) -> None:
    """Add a line in one write, so that a killed process leaves no half line."""
    with (run / LOG).open("ab", buffering=0) as log:
        log.write(line.model_dump_json().encode() + b"\n")


def _last_epoch(run: Path) -> int:
    return int(read_fields(run / LAST)["epoch"]) if (run / LAST).is_file() else 0


def _now() -> str:
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
