"""The table of bounds: each once, and all of them used."""

from __future__ import annotations

from conftest import REPOSITORY

from bsg_data.inputs import bounds
from bsg_data.inputs.bounds import BOUNDS, Bound


def test_every_bound_is_in_the_table_once_and_read_by_somebody() -> None:
    named = {name: value for name, value in vars(bounds).items() if isinstance(value, Bound)}
    assert tuple(named.values()) == BOUNDS
    assert len({bound.what for bound in BOUNDS}) == len(BOUNDS)
    assert all(bound.bytes > 0 for bound in BOUNDS)
    folders = (REPOSITORY / folder for folder in ("bsg_data", "bsg_models", "cli"))
    files = [path for folder in folders for path in folder.rglob("*.py")]
    text = "\n".join(path.read_text("utf-8") for path in files if path.name != "bounds.py")
    assert [name for name in named if name not in text] == []
