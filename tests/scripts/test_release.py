from __future__ import annotations

import datetime
import subprocess
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
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


def test_what_was_unreleased_gets_a_date() -> None:
    today = datetime.date(2026, 1, 2)
    text = "# Changelog\n\n## Unreleased\n\n- new\n"
    dated = RELEASE.date_changelog(text, "1.0.0", today)
    assert dated == "# Changelog\n\n## 1.0.0 (2026-01-02)\n\n- new\n"
    with pytest.raises(click.ClickException):
        RELEASE.date_changelog(dated, "1.1.0", today)


def test_a_checkout_that_is_not_ready_is_left_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (*RELEASE.PLACES, "CHANGELOG.md"):
        (tmp_path / name).write_bytes((REPOSITORY / name).read_bytes())
    git = ("git", "-c", "user.name=A", "-c", "user.email=a@b.c")
    for words in (("init", "-q", "-b", "main"), ("add", "."), ("commit", "-qm", "one")):
        subprocess.run([*git, *words], cwd=tmp_path, check=True)
    monkeypatch.setattr(RELEASE, "REPOSITORY", tmp_path)
    assert CliRunner().invoke(RELEASE.main, ["1.0"]).exit_code == 1
    (tmp_path / "CHANGELOG.md").write_text("mine")
    assert CliRunner().invoke(RELEASE.main, ["1.0.0"]).exit_code == 1
    assert (tmp_path / "CHANGELOG.md").read_text() == "mine"
    assert RELEASE.tell("git", "rev-list", "--count", "HEAD") == "1"
