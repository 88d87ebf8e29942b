"""A checkpoint is what was saved, or it is refused; so is an answer that is no number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from configurations import configure
from conftest import REPOSITORY
from safetensors.numpy import save_file

from bsg_cli.belief import main
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_models.belief.expectation import from_totals
from bsg_models.errors import CheckpointError, PredictionError
from bsg_models.evaluation.measurement import predict_all
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import (
    Checkpoint,
    load_checkpoint,
    make_header,
    name_tensors,
    restore_model,
    save_checkpoint,
)
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.training.training import new_model
from bsg_models.zoo.catalogue import ZOO

OFFICE = REPOSITORY / "docs" / "office.json"


@pytest.fixture
def path(run: Path) -> Path:
    """The checkpoint of a small model, which was trained once for all tests."""
    return run / BEST


def test_a_flipped_byte_is_refused_where_the_hash_is_listed(path: Path) -> None:
    whole = path.read_bytes()
    for position in (0, 8, len(whole) // 2, len(whole) - 1):
        changed = bytearray(whole)
        changed[position] ^= 1
        path.write_bytes(changed)
        with pytest.raises(CheckpointError):
            load_checkpoint(path)


def test_the_same_checkpoint_has_the_same_bytes(path: Path, tmp_path: Path) -> None:
    loaded = load_checkpoint(path)
    save_checkpoint(tmp_path / "again", loaded.header, loaded.tensors)
    assert (tmp_path / "again").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"checkpoint_version": 0}', "version 0.*train again"),
        ('{"checkpoint_version": 999}', "version 999.*upgrade belief-scene-graphs"),
        ("[" * 100_000, "its header is not a checkpoint's"),
        ("5", "its header is not a checkpoint's"),
    ],
)
def test_a_header_of_another_program_or_version_is_refused(
    path: Path, text: str, words: str
) -> None:
    save_file({"x": np.zeros(1)}, path, metadata={"bsg": text})
    with pytest.raises(CheckpointError, match=words):
        load_checkpoint(path)


@pytest.mark.parametrize(
    ("header", "size"),
    [
        (10, 17),
        (0, 4),
        (2**63, 100),
    ],
)
def test_what_is_cut_off_is_not_read(tmp_path: Path, header: int, size: int) -> None:
    path = tmp_path / "model.safetensors"
    with path.open("wb") as file:  # takes no room on the disk
        file.write(header.to_bytes(8, "little"))
        file.truncate(size)
    with pytest.raises(CheckpointError, match="cut off or not safetensors"):
        load_checkpoint(path)


def test_a_network_of_another_width_is_refused_in_a_line(dataset: Path) -> None:
    data = Dataset.open(dataset)
    wide = name_tensors("model", new_model(configure("ceci", "model.width=8"), data).state())
    header = make_header(configure("ceci", "model.width=4"), data, vocabulary=())
    words = r"^x: tensor blocks\.0\.0\.bias: expected the shape \(4,\), found \(8,\)$"
    with pytest.raises(CheckpointError, match=words):
        restore_model("x", Checkpoint(header, wide))


def test_an_answer_that_is_not_finite_is_an_error(
    path: Path, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def predict(self: object, seen: Observation) -> object:
        totals = seen.inputs.astype(float)
        totals[-1, -1] = np.nan
        return from_totals(seen.inputs.astype(float), totals)

    monkeypatch.setattr(ZOO["gamma-poisson"].make, "predict", predict)
    model = restore_model(path, load_checkpoint(path))
    masked = read_split(Dataset.open(dataset), "val")
    with pytest.raises(PredictionError, match=rf"{path}: the model's answer is not finite"):
        predict_all(model, masked)
    out = tmp_path / "belief.json"
    done = CliRunner().invoke(main, [str(OFFICE), "--model", str(path.parent), "--out", str(out)])
    assert done.exit_code == 1
    assert "is not finite" in done.stderr
    assert done.stdout == ""
    assert not out.exists()
