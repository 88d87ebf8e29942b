"""A reader that is fed with anything, and what it must not do then."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import os
import tempfile
import traceback
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from bsg_data.errors import BSGError
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap, load_class_map
from bsg_data.sources.source import Source

CORPUS = Path(__file__).parent / "corpus"
MEMORY = Path("/dev/shm")
PACKAGES = ("bsg_data", "bsg_models", "bsg_cli", "cli")


@dataclass(frozen=True)
class Target:
    """A reader.

    Attributes:
        name: of the reader; that of its folder in `corpus/`, too.
        read: puts an input where the reader wants it, an empty folder at first, and reads it.
        seeds: makes sound inputs by name, as small as they can be.
        most: bytes of a seed; changed inputs have up to `longest`.
    """

    name: str
    read: Callable[[Path, bytes], object]
    seeds: Callable[[], Mapping[str, bytes]]
    most: int = 2_000

    @property
    def longest(self) -> int:
        """Bytes of an input: enough for 5,000 digits, and no more, so that reading is quick."""
        return self.most + 6_000

    def kept(self) -> dict[str, bytes]:
        """Return the inputs that failed once, by the names of their files."""
        return {path.name: path.read_bytes() for path in sorted((CORPUS / self.name).glob("*"))}


class Finding(NamedTuple):
    """What a reader must not do: the same key for findings of one cause, and all that is known."""

    key: str
    text: str


class Bench:
    """Where a target reads: a folder of its own in memory, in a working directory that stays empty.

    A context: it changes the working directory of this process, where it makes temporary files, and
    what it does about warnings.
    """

    def __init__(self, target: Target) -> None:
        self.target = target

    def __enter__(self) -> Bench:
        """Make the folder, and read the seeds, so that all is imported."""
        memory = MEMORY if os.access(MEMORY, os.W_OK) else None
        with contextlib.ExitStack() as stack:
            root = stack.enter_context(tempfile.TemporaryDirectory(prefix="fuzz", dir=memory))
            self.folder, self._elsewhere = Path(root, "input"), Path(root, "elsewhere")
            self.folder.mkdir()
            self._elsewhere.mkdir()
            for data in self.target.seeds().values():  # what libraries make at import is not ours
                self.target.read(self.folder, data)
            stack.callback(setattr, tempfile, "tempdir", tempfile.tempdir)
            tempfile.tempdir = str(self._elsewhere)
            stack.enter_context(contextlib.chdir(self._elsewhere))
            stack.enter_context(warnings.catch_warnings())
            warnings.simplefilter("error")
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *raised: object) -> None:
        """Remove it."""
        self._stack.close()

    def try_input(self, data: bytes) -> Finding | None:
        """Read an input, and return what the reader must not have done."""
        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                self.target.read(self.folder, data)
        except KeyboardInterrupt:
            raise
        except BSGError as error:
            if not str(error).strip():
                return Finding(f"{type(error).__name__} without a word", traceback.format_exc())
        except BaseException as error:  # a panic of a library in Rust is no Exception
            return _describe(error)
        if said.tell():
            return Finding(f"{self.target.name} prints", said.getvalue())
        if strays := [path.name for path in self._elsewhere.iterdir()]:
            return Finding(f"{self.target.name} writes", f"in the working directory: {strays}")
        return None


def _describe(error: BaseException) -> Finding:
    """Name an error by its type and the last function of ours that it went through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if any(f"/{package}/" in f.filename for package in PACKAGES)]
    last = ours[-1] if ours else frames[-1]
    key = f"{type(error).__name__} in {Path(last.filename).name}, {last.name}"
    return Finding(key, "".join(traceback.format_exception(error)))


_count = itertools.count()


def put(folder: Path, name: str, data: bytes) -> Path:
    """Write an input as the one file of a folder, under a name that no input before it had.

    Readers that keep what they read would otherwise take two files of one moment for one.
    """
    for path in folder.iterdir():
        path.unlink()
    path = folder / f"{next(_count)}{name}"
    path.write_bytes(data)
    return path


def load_map() -> ClassMap:
    """Load a class map, without what it remembers of the names that it was asked for."""
    class_map = load_class_map(DEFAULT_CLASS_MAP)
    class_map._resolved.clear()
    return class_map


def read_source(source: Source, class_map: ClassMap) -> None:
    """Find the scenes of a source, and read the first ones."""
    for ref in source.find().scenes[:4]:
        source.read(ref, class_map)


def encode(document: object) -> bytes:
    """Return a document as JSON, as seeds have it."""
    return json.dumps(document, ensure_ascii=False, separators=(",", ":")).encode()
