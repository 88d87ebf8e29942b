"""All errors that the project raises on purpose, in `bsg_data` and in `bsg_models`.

    BSGError                   base class of all errors of the project
    ├── SourceError            a source is missing, unreadable or empty
    │   ├── AnnotationError    one line of one annotation file is malformed
    │   └── SourceChangedError  a source changed after its scenes were listed
    ├── ClassMapError          a class map is missing, malformed, changed, or lacks a name
    ├── DatasetError           a dataset is missing, unfinished, damaged, or exists already
    │   └── MismatchError      class spaces or format versions differ
    ├── RecipeError            a mask, split or build is impossible as asked
    │   └── ConfigError        a configuration has an unknown name or an impossible value
    ├── CheckpointError        a checkpoint is missing, damaged, or belongs to another model or run
    ├── PredictionError        a prediction is not finite, or a file of predictions is faulty
    ├── TrainingError          a training cannot start or continue
    └── BeliefFileError        a file or a graph is not a belief graph of this project
        └── HydraError         a file is not a scene graph of Hydra, or its library is missing

`bsg_models` exports ConfigError and the errors below it. Errors of one kind of file, such as
unreadable meshes, are defined in its module as subclasses of these. A message names the file, the
line or the id, what was expected, what was found, and what to do.
"""

from __future__ import annotations

import errno

_PERMANENT = {errno.EACCES, errno.EPERM, errno.ELOOP, errno.ENAMETOOLONG, errno.EISDIR}


class BSGError(Exception):
    """Be the base class of all errors that the project raises on purpose.

    Attributes:
        code: kind of fault in kebab-case, such as `line-malformed`: what programs compare.
        where: file, line, key or id at fault; empty if the message is about none of these.
    """

    def __init__(self, message: str = "", *, code: str = "", where: object = "") -> None:
        super().__init__(message)
        self.code, self.where = code, str(where)


class SourceError(BSGError):
    """Report a source that is missing, unreadable or empty."""


class AnnotationError(SourceError):
    """Report one malformed line of an annotation file."""


class SourceChangedError(SourceError):
    """Report a source that changed or became unreadable after its scenes were listed.

    It is not the fault of a scene, so no scene is skipped because of it.
    """


def find_io_error(error: BaseException | None) -> OSError | None:
    """Return the system error behind an error, if another try may succeed; else None.

    Such causes are a failing disk or network and a missing file. Wrong permissions and damaged
    bytes do not count, because they stay.
    """
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None and error.errno not in _PERMANENT:
            return error
        error = error.__cause__
    return None


class ClassMapError(BSGError):
    """Report a class map that is missing, malformed or changed, or lacks a name (`--strict`)."""


class DatasetError(BSGError):
    """Report a dataset that is missing, unfinished or damaged, or a path that is taken."""


class MismatchError(DatasetError):
    """Report two things whose class spaces or format versions differ, so they cannot be mixed."""


class RecipeError(BSGError, ValueError):
    """Report a mask, a split or a build that is impossible as asked.

    It is a ValueError too, so that a record can report it with the path of the faulty key.
    """


EXTRA_OF = {  # package → the extra that brings it
    "matplotlib": "figures",
    "networkx": "train",
    "onnx": "onnx",
    "onnxscript": "onnx",
    "pandas": "train",
    "scipy": "meshes",
    "torch": "train",
    "torch_geometric": "train",
}


def ask_to_upgrade(found: object, known: int, *, otherwise: str) -> str:
    """Return what to do about a file of another format version, as errors end."""
    is_newer = isinstance(found, int) and found > known
    return "a newer program wrote it: upgrade belief-scene-graphs" if is_newer else otherwise


def ask_to_install(extra: str) -> str:
    """Return the command that installs an extra, as errors end.

    It names an address, never the bare name: on a package index, that name may be a stranger's.
    """
    return f"pip install '.[{extra}]' in your clone of the project (or name your wheel for the dot)"
