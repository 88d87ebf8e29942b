"""What training rooms show and hide under masks: the sample that counting models count."""

from __future__ import annotations

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked, stack_masked
from bsg_data.recipes import MaskRecipe
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.settings import DataConfig


def sample_uniform(data: Dataset, choice: DataConfig, *, draws: int) -> MaskedBuildings:
    """Return the training buildings under uniform masks of the choice's fraction.

    Uniform whatever the strategy: what a class says of another shows in rooms that are seen.

    Raises:
        TrainingError: if the fraction is 0.
    """
    if not choice.mask.fraction:
        raise TrainingError("masks that hide nothing teach nothing: raise data.mask.fraction")
    mask = MaskRecipe(fraction=choice.mask.fraction, seed=choice.mask.seed)
    plain = choice.model_copy(update={"mask": mask, "fractions": None, "withhold": 0.0})
    return sample_chosen(data, plain, draws=draws)


def sample_chosen(
    data: Dataset, choice: DataConfig, *, draws: int, vocabulary: tuple[str, ...] = ()
) -> MaskedBuildings:
    """Return the training buildings under the choice's own fresh masks."""
    scenes = scenes_of(data, "train", fold=choice.fold)
    return stack_masked(
        [
            sample_masked(
                data,
                scenes,
                mask=choice.fresh_mask,
                draw=draw,
                fractions=choice.fractions,
                vocabulary=vocabulary,
            )
            for draw in range(draws)
        ]
    )
