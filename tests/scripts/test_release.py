from __future__ import annotations

import click
import pytest
from conftest import REPOSITORY, load_script

RELEASE = load_script("package/release")


def test_the_version_stands_where_it_is_looked_for() -> None:
    """In every file once, and nothing else changes."""
    for name, pattern in RELEASE.PLACES.items():
        old = (REPOSITORY / name).read_text("utf-8")
        new = RELEASE.set_version(old, pattern, "7.8.9")
        changed = {*new.splitlines()} - {*old.splitlines()}
        assert len(changed) == 1
        assert "7.8.9" in changed.pop()
    with pytest.raises(click.ClickException):
        RELEASE.set_version("version = '1'", RELEASE.PLACES["pyproject.toml"], "2.0.0")
