"""Write files so that they are complete or absent: beside their final path, then renamed."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from bsg_data.errors import DatasetError


@contextmanager
def open_beside(path: Path) -> Iterator[Path]:
    """Yield a path beside a file's place; rename it there when the block ends well.

    The folder is made where it is missing. What was at `path` stays until the rename, and for good
    if the block raises. The data reach the disk before the rename does, and the name before the
    function returns.

    Raises:
        DatasetError: if the file cannot be written, or its place is no file's, as `/dev/null`.
    """
    refuse_devices(path)
    partial = path.with_name(f".{path.name}.partial")
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.unlink(missing_ok=True)  # of a killed command; a link there is never followed
            yield partial
            flush_file(partial)
            partial.replace(path)
            flush_folder(path.parent)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_bytes(path: Path, data: bytes) -> None:
    """Write a small file beside its place and rename it there.

    Raises:
        DatasetError: if it cannot be written; what was there stays.
    """
    with open_beside(path) as partial, partial.open("xb") as file:
        file.write(data)


def encode_json(value: object, **style: Any) -> str:
    """Return a value as JSON, which has no NaN and no infinity; all that we write goes through it.

    Args:
        value: of what JSON knows.
        style: as `json.dumps` takes it.

    Raises:
        DatasetError: if a number in it is not finite.
    """
    try:
        return json.dumps(value, allow_nan=False, **style)  # noqa: TID251
    except ValueError as error:
        raise DatasetError(
            f"a number that was computed is not finite, and JSON has none such ({error}); nothing "
            "was written: please report it"
        ) from error


def stem_of(name: str) -> str:
    """Return a name as the stem of a file: other characters than letters, digits and -_. are -.

    >>> stem_of("ceci-gcn (second)"), stem_of("../owner/name")
    ('ceci-gcn-second', 'owner-name')
    """
    return re.sub(r"[^\w.-]+", "-", name).strip("-.") or "-"


def refuse_links(root: Path, path: Path) -> None:
    """Refuse a place below a folder of ours that a link leads to: it may lie anywhere.

    Args:
        root: the folder that a user named, which may be a link itself.
        path: below it, there or not.

    Raises:
        DatasetError: naming the link.
    """
    for place in (path, *path.parents):
        if place == root:
            return
        if place.is_symlink():
            raise DatasetError(f"{place}: is a link, and nothing is written through one; remove it")


def refuse_devices(path: Path) -> None:
    """Refuse a place that holds a device, a pipe or a socket: a rename would put an end to it.

    Raises:
        DatasetError: naming it.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise DatasetError(f"{path}: is a device or a pipe, and only a file is replaced")


def flush_file(path: Path) -> None:
    """Have the data of a file reach the disk.

    Raises:
        OSError: if they do not.
    """
    descriptor = os.open(path, os.O_RDWR)  # Windows flushes only what is open for writing
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def flush_folder(path: Path) -> None:
    """Have the names in a folder reach the disk, where the system can do that for a folder."""
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
