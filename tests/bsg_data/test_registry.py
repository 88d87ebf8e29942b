from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bsg_data import registry
from bsg_data.errors import RecipeError
from bsg_data.registry import Registry

ROWS = {"pi": "math:pi", "e": "math:e", "path": "pathlib:Path"}


def numbers() -> Registry[float]:
    return Registry("number", float, group="bsg_test.numbers", rows=ROWS)


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A package on `sys.path` with entry points of its own."""
    (tmp_path / "constants.py").write_text("tau = 6.28\nword = 'six'\npi = 3.0\n")
    info = tmp_path / "constants-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: constants\nVersion: 1\n")
    (info / "entry_points.txt").write_text(
        "[bsg_test.numbers]\ntau = constants:tau\nword = constants:word\n"
        "gone = constants_that_are_not:x\npi = constants:pi\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    registry._installed.cache_clear()
    yield
    registry._installed.cache_clear()
    sys.modules.pop("constants", None)


def test_rows_are_loaded_by_name() -> None:
    assert numbers()["pi"] == pytest.approx(3.14159, abs=1e-5)
    assert "e" in numbers()
    assert "tau" not in numbers()
    assert list(numbers()) == ["pi", "e", "path"]


def test_an_unknown_name_gets_the_nearest() -> None:
    with pytest.raises(RecipeError, match=r"no number 'pii'; did you mean pi\? Known are pi, e"):
        numbers()["pii"]


def test_a_row_of_another_kind_is_refused() -> None:
    with pytest.raises(RecipeError, match="number 'path': pathlib:Path is a type, expected a floa"):
        numbers()["path"]


@pytest.mark.usefixtures("installed")
def test_entry_points_follow_the_rows_and_cannot_replace_them() -> None:
    assert numbers().names() == ("pi", "e", "path", "gone", "tau", "word")
    assert "constants" not in sys.modules
    assert numbers()["tau"] == 6.28
    assert numbers()["pi"] != 3.0


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize("name", ["word", "gone"])
def test_a_bad_entry_point_is_named(name: str) -> None:
    with pytest.raises(RecipeError, match=f"number '{name}': "):
        numbers()[name]


def test_a_row_whose_library_is_not_installed_says_what_to_install() -> None:
    rows = Registry("number", float, group="bsg_test.numbers", rows={"phi": "not_there:phi"})
    with pytest.raises(RecipeError, match=r"needs not_there, which is not installed; .*\[all\]"):
        rows["phi"]
