"""The seal of a folder of results: `SHA256SUMS`, which `sha256sum -c` checks, too."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import refuse_links, write_bytes
from bsg_data.inputs.bounded_file import hash_file

SEAL = "SHA256SUMS"
_LINE = re.compile(r"(?P<sha256>[0-9a-f]{64})  (?P<name>(?!/)[^\\\x00-\x1f]+)")


def write_seal(folder: Path, names: Iterable[str]) -> None:
    """Write the seal of some files of a folder."""
    lines = [f"{hash_file(folder / name)}  {name}\n" for name in names]
    write_bytes(folder / SEAL, "".join(lines).encode())


def read_seal(folder: Path) -> dict[str, str] | None:
    """Return file → sha256 of the seal of a folder; None if it has none."""
    path = folder / SEAL
    if not path.is_file():
        return None
    sums: dict[str, str] = {}
    # Lines of bytes: a name may hold a U+2028, at which `str.splitlines` splits.
    for number, data in enumerate(path.read_bytes().splitlines(), 1):
        line = data.decode("utf-8", "replace")
        found = _LINE.fullmatch(line)
        if found is None or ".." in found["name"].split("/") or found["name"] in sums:
            raise DatasetError(
                f"{path}, line {number}: expected a sha256, two spaces and the name of a file in "
                f"the folder, with each file once; found {line[:120]!r}",
                code="seal-line",
                where=f"{path}, line {number}",
            )
        sums[found["name"]] = found["sha256"]
    return sums


def require_seal(folder: Path) -> dict[str, str] | None:
    """Check a folder against its seal and return the seal; None if it has none."""
    sums = read_seal(folder)
    for name, expected in (sums or {}).items():
        path = folder / name
        try:
            refuse_links(folder, path)
            found = hash_file(path)
        except OSError as error:
            message = f"{path}: expected by {SEAL}, but cannot be read ({error.strerror or error})"
            raise DatasetError(message, code="file-missing", where=path) from error
        if found != expected:
            raise DatasetError(
                f"{path}: was changed: expected sha256 {expected[:12]}… by {SEAL}, found "
                f"{found[:12]}…; take another copy, or make it again",
                code="file-changed",
                where=path,
            )
    return sums


def refuse_other_results(folder: Path, report: str) -> None:
    """Refuse a folder with results of another kind, whose seal does not list this report."""
    sealed = read_seal(folder)
    if sealed and report not in sealed:
        raise DatasetError(
            f"{folder}: holds other results ({min(sealed)}), which would become incomplete; choose "
            "another folder",
            code="other-results",
            where=folder,
        )
