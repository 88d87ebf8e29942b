"""A release changes the version and the changelog; by hand, on files of the repository."""

from __future__ import annotations

import datetime
import re

import click
import pytest
from conftest import REPOSITORY, load_script

RELEASE = load_script("package/release")


@pytest.mark.parametrize("name", RELEASE.PLACES)
def test_the_version_stands_once_in_each_place(name: str) -> None:
    text, pattern = (REPOSITORY / name).read_text("utf-8"), RELEASE.PLACES[name]
    changed = RELEASE.set_version(text, pattern, "7.8.9")
    assert changed.count("7.8.9") == 1
    current = RELEASE.find_version((REPOSITORY / "pyproject.toml").read_text("utf-8"))
    assert RELEASE.set_version(changed, pattern, current) == text


def test_a_version_that_stands_twice_is_refused() -> None:
    with pytest.raises(click.ClickException, match="found 2"):
        RELEASE.set_version("version: 1.0.0\nversion: 1.0.0\n", r"^version: (\S+)$", "1.1.0")


def test_the_changelog_gets_the_version_and_the_day() -> None:
    text = "# Changelog\n\n## Unreleased\n\n- more\n\n## 0.1.0 (2026-01-01)\n"
    dated = RELEASE.date_changelog(text, "7.8.9", datetime.date(2030, 1, 2))
    assert dated == text.replace("Unreleased", "7.8.9 (2030-01-02)")


def test_the_changelog_says_what_is_released() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text("utf-8")
    assert text.count("\n## Unreleased\n") <= 1
    assert re.search(r"^## (Unreleased|\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\))$", text, re.MULTILINE)


@pytest.mark.parametrize("version", ["1", "v1.2.3", "1.2.3rc1", "1.2.3; rm -rf"])
def test_what_is_no_version_is_refused(version: str) -> None:
    with pytest.raises(click.ClickException, match="expected a version like"):
        RELEASE.require_ready(version)


def test_what_is_tried_out_is_the_demo() -> None:
    lines = list(load_script("package/try_out").demo_lines())
    programs = {line.split()[0] for line in lines}
    assert {"bsg-data", "bsg-train", "bsg-evaluate", "bsg-search"} <= programs
    assert not any("$(" in line for line in lines)
