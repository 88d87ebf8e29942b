"""Every error that the project raises on purpose, drawn once: those of `bsg_models`, too.

    BSGError                   above all errors of the project
    ├── SourceError            a source is not where it should be, or holds nothing
    │   ├── AnnotationError    one line of one annotation file is malformed
    │   └── SourceChangedError  a source is not what it was when its scenes were listed
    ├── ClassMapError          a class map is missing, malformed or not the published one
    │   └── UnmappedNameError  a name is not in the class map, and the caller asked for strictness
    ├── DatasetError           a dataset is missing, unfinished, damaged or already there
    │   └── MismatchError      two things of different class maps or formats would be mixed
    ├── RecipeError            a mask, split or build was asked for that cannot be made
    │   └── ConfigError        a configuration names something that is not, or cannot be
    ├── CheckpointError        a checkpoint is missing, damaged, or of another shape or run
    ├── PredictionError        a model's answer is not finite, or a file of predictions is faulty
    ├── TrainingError          a training cannot start or go on
    └── BeliefFileError        a file or a graph is no belief graph of ours
        └── HydraError         a file is no scene graph of Hydra's, or Hydra's library is missing

ConfigError and those below it belong to `bsg_models` and are exported by it. Some errors are of one
kind of file, such as a mesh that cannot be read, and stay in its module below one of these. A
message names the file, the line or the id, what was expected, what was found, and what to do.
"""

from __future__ import annotations

import errno
from pathlib import Path

_LASTING = {errno.EACCES, errno.EPERM, errno.ELOOP, errno.ENAMETOOLONG, errno.EISDIR}


class BSGError(Exception):
    """Stand above every error that the project raises on purpose."""


class SourceError(BSGError):
    """Report a source that is missing, unreadable or empty."""


class AnnotationError(SourceError):
    """Report one malformed line of an annotation file.

    Attributes:
        path: the file.
        line_number: counted from 1, or None when the whole file is at fault.
        line: the offending text, shortened.
        expected: what should have stood there.
    """

    def __init__(
        self, path: Path | str, line_number: int | None, line: str, *, expected: str
    ) -> None:
        self.path = Path(path)
        self.line_number = line_number
        self.line = line if len(line) <= 120 else line[:117] + "..."
        self.expected = expected
        where = f"{self.path}" if line_number is None else f"{self.path}, line {line_number}"
        super().__init__(f"{where}: expected {expected}, found {self.line!r}")

    def __reduce__(self) -> tuple[object, ...]:
        """Survive the way back from a worker process."""
        return _annotation_error, (self.path, self.line_number, self.line, self.expected)


class SourceChangedError(SourceError):
    """Report a source that changed, went away or could not be read since its scenes were listed.

    It is no fault of a scene, so that no scene is skipped for it.
    """


def find_io_error(error: BaseException | None) -> OSError | None:
    """Return what the system said, if it is why something could not be read now.

    Of the causes of an error: a disk or a network that fails, a file that is gone. Permissions, and
    what is wrong with bytes that were read, are there the next time, too.
    """
    while error is not None:
        if isinstance(error, OSError) and error.errno is not None and error.errno not in _LASTING:
            return error
        error = error.__cause__
    return None


def _annotation_error(
    path: Path, line_number: int | None, line: str, expected: str
) -> AnnotationError:
    return AnnotationError(path, line_number, line, expected=expected)


class ClassMapError(BSGError):
    """Report a class map that is missing, malformed or changed since it was published."""


class UnmappedNameError(ClassMapError):
    """Report a name that the class map does not know, under `--strict`."""


class DatasetError(BSGError):
    """Report a dataset that is missing, unfinished, damaged or in the way."""


class MismatchError(DatasetError):
    """Report two things of different class maps or format versions that would be mixed."""


class RecipeError(BSGError, ValueError):
    """Report a mask, a split or a build that cannot be made as asked.

    A ValueError too: what a validator of a record raises is reported with the path of its key.
    """
