from __future__ import annotations

from pathlib import Path

import click
import pytest

from bsg_cli.configurations import load_config
from bsg_models.zoo.config import find_config


def test_a_name_of_the_zoo_comes_before_a_file_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mixture").write_text("no TOML", "utf-8")
    assert load_config("mixture") == find_config("mixture")
    assert load_config("mixture", ("seed=3",)).seed == 3
    Path("mine").write_text('[model]\nfamily = "input"\n', "utf-8")
    assert load_config("mine") == find_config("input")


def test_a_name_that_is_neither_is_wrong_usage() -> None:
    with pytest.raises(click.UsageError, match="did you mean mixture"):
        load_config("mixtrue")
