"""What training rooms show and hide under masks: the sample that counting models count."""

from __future__ import annotations

from torch_geometric.data import Batch, Data

from bsg_data.recipes import MaskRecipe
from bsg_models.errors import TrainingError
from bsg_models.inputs.graphs import Buildings, MaskedGraphs
from bsg_models.zoo.config import DataConfig


def sample_uniform(data: Buildings, choice: DataConfig, *, draws: int) -> Data:
    """Return the training buildings under uniform masks of the choice's fraction, as one batch.

    Uniform whatever the strategy: what a class says of another shows in rooms that are seen.

    Raises:
        TrainingError: if the fraction is 0.
    """
    if not choice.mask.fraction:
        raise TrainingError("masks that hide nothing teach nothing: raise data.mask.fraction")
    mask = MaskRecipe(fraction=choice.mask.fraction, seed=choice.mask.seed)
    plain = choice.model_copy(update={"mask": mask, "fractions": None, "withhold": 0.0})
    return _draw(data, plain, draws=draws)


def sample_chosen(
    data: Buildings, choice: DataConfig, *, draws: int, vocabulary: tuple[str, ...]
) -> Data:
    """Return the training buildings under the choice's own fresh masks, as one batch."""
    return _draw(data, choice, draws=draws, vocabulary=vocabulary)


def _draw(
    data: Buildings, choice: DataConfig, *, draws: int, vocabulary: tuple[str, ...] = ()
) -> Data:
    graphs = [
        graph
        for draw in range(draws)
        for graph in MaskedGraphs.fresh(
            data,
            "train",
            mask=choice.mask,
            draw=draw,
            fractions=choice.fractions,
            withhold=choice.withhold,
            fold=choice.fold,
            edges=(),
            vocabulary=vocabulary,
        )
    ]
    return Batch.from_data_list(graphs)
