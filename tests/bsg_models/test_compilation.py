"""numba reads nothing from the working folder, by hand and in processes of their own."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from bsg_data.errors import BSGError
from bsg_models import compilation
from bsg_models.compilation import CONFIG, compiled, has_home, refuse_config


def test_a_function_is_compiled_and_gives_what_it_gives() -> None:
    @compiled()
    def double(number: int) -> int:
        return 2 * number

    assert double(21) == 42
    assert double.nopython_signatures


def test_the_file_of_numba_is_refused(tmp_path: Path) -> None:
    refuse_config(tmp_path)
    (tmp_path / CONFIG).write_text("cache_dir: cache")
    with pytest.raises(BSGError, match=r"\.numba_config\.yaml: numba would read this file"):
        refuse_config(tmp_path)


def test_numba_looks_for_its_file_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / CONFIG).write_text("a: [")  # no YAML: whoever reads it raises
    compilation.config.reload_config()


def test_without_a_home_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """numba's cache would be a folder named `~` below the working folder."""
    assert has_home() or not os.environ.get("HOME")

    def unknown(path: Path) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "expanduser", unknown)
    assert not has_home()
