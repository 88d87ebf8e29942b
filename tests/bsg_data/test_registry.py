from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from refusals import refuses

from bsg_data import registry
from bsg_data.errors import RecipeError
from bsg_data.registry import Registry

ROWS = {"pi": "math:pi", "e": "math:e", "path": "pathlib:Path", "phi": "not_there:phi"}


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
    assert list(numbers()) == list(ROWS)


@pytest.mark.parametrize(
    ("name", "code"), [("pii", "name-unknown"), ("path", "row-type"), ("phi", "library-missing")]
)
def test_a_name_that_stands_for_nothing_is_refused(name: str, code: str) -> None:
    with refuses(RecipeError, code, name):
        numbers()[name]


def test_what_trains_is_asked_for_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    tensors = Registry("tensor", object, group="bsg_test.tensors", rows={"zero": "torch:zeros"})
    with pytest.raises(RecipeError, match=r"needs torch.*pip install '\.\[train\]'"):
        tensors["zero"]


@pytest.mark.usefixtures("installed")
def test_entry_points_follow_the_rows_and_cannot_replace_them() -> None:
    assert numbers().names() == (*ROWS, "gone", "tau", "word")
    assert "constants" not in sys.modules
    assert numbers()["tau"] == 6.28
    assert numbers()["pi"] != 3.0


@pytest.mark.usefixtures("installed")
def test_a_bad_entry_point_is_named() -> None:
    with refuses(RecipeError, "entry-point-broken", "gone"):
        numbers()["gone"]
    rows, faults = numbers().load_all()
    assert list(rows) == ["pi", "e", "tau"]
    assert len(faults) == 4
