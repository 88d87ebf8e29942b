"""Packages beside the project, on `sys.path` as pip installs them."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY, tomllib

from bsg_data import registry
from bsg_models import testing

EXAMPLES = REPOSITORY / "docs" / "examples"


def read_project(text: str) -> dict[str, Any]:
    """Return the table `project` of a pyproject.toml."""
    return dict(tomllib.loads(text)["project"])


@contextmanager
def installed(project: Mapping[str, Any], folder: Path, site: Path) -> Iterator[None]:
    """Install the package of a folder until the block ends; `site` takes what pip says of it."""
    (package,) = {
        target.partition(".")[0]
        for rows in project["entry-points"].values()
        for target in rows.values()
    }
    info = site / f"{package}-1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1\n")
    lines = [
        line
        for group, rows in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {target}" for name, target in rows.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join([*lines, ""]))
    with pytest.MonkeyPatch.context() as patch:
        for path in {folder, site}:
            patch.syspath_prepend(str(path))
        registry._installed.cache_clear()
        yield
    registry._installed.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]
    testing._fit.cache_clear()  # its models are of modules that are gone
