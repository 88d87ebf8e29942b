"""One command makes the shipped models: twice the same bytes, and each is found and answers."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from conftest import load_script

from bsg_models.runs import found_model as shipped_module
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.found_model import read_shipped_card, shipped_names
from bsg_models.runs.model_card import list_shipped, read_card
from bsg_models.runs.predictor import Predictor

SHIP = load_script("weights/ship")
TINY = (
    *("--config-of", "universal=ceci-sage", "--set", "universal:training.epochs=1"),
    *("--set", "universal:training.validate_every=1", "--set", "universal:model.width=8"),
    *("--set", "universal:data.min_scenes=4", "--set", "mixture:model.types=2"),
    *("--set", "mixture:model.iterations=2"),
)


def ship(pooled: Path, folder: Path, *more: str) -> int:
    folders = ("--work", str(folder / "work"), "--out", str(folder / "weights"))
    words = ("--pooled", str(pooled), *folders, "--only", "universal", "--only", "mixture")
    return int(SHIP.main([*words, *TINY, *more]))


@pytest.mark.heavy
def test_models_are_made_twice_with_the_same_bytes(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    assert ship(dataset, first) == 0
    assert ship(dataset, second) == 0
    files = sorted(path.name for path in (first / "weights").iterdir())
    assert files == [
        *("SHA256SUMS", "mixture.md", "mixture.safetensors"),
        *("universal.md", "universal.safetensors"),
    ]
    for name in files:
        assert (first / "weights" / name).read_bytes() == (second / "weights" / name).read_bytes()

    monkeypatch.setattr(shipped_module, "weights_folder", lambda: first / "weights")
    assert shipped_names() == ("universal", "mixture")
    assert [one.data for one in list_shipped()] == ["12 buildings of hm3d"] * 2
    assert Predictor().name == "universal"
    header = load_checkpoint(first / "weights" / "universal.safetensors").header
    assert header.config.name == "ceci-sage"  # as the test had it made
    card = read_shipped_card("universal")
    assert read_card(card, origin="card").licence == "LicenseRef-matterport-academic"
    assert "<!-- generated: accuracy universal -->" in card
    assert "none of these was found" in card
    assert "surprises it by" in card
    tensors = load_checkpoint(first / "weights" / "universal.safetensors").tensors
    assert {str(one.dtype) for one in tensors.values() if one.dtype.kind == "f"} == {"float32"}
    assert all(name.startswith("model.") for name in tensors)

    # Without its runs a model would be trained again; what is finished is not.
    monkeypatch.setattr(SHIP, "train_run", None)
    shutil.rmtree(first / "weights")
    assert ship(dataset, first) == 0
    for name in files:
        assert (first / "weights" / name).read_bytes() == (second / "weights" / name).read_bytes()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--only", "univresal"), "did you mean universal?"),
        (("--only", "open"), "open needs --behavior"),
        (("--set", "mixture:model.typse=2"), "did you mean types?"),
    ],
)
def test_what_cannot_be_made_is_said(
    dataset: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    said: str,
) -> None:
    folders = ("--work", str(tmp_path / "work"), "--out", str(tmp_path / "weights"))
    only = () if "--only" in words else ("--only", "mixture")
    assert SHIP.main(["--pooled", str(dataset), *folders, *only, *words]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "weights").exists()
