"""Adam as the paper has it (section IV-A), and its state by name for checkpoints."""

from __future__ import annotations

from pathlib import Path

import torch

from bsg_models.config import TrainingConfig
from bsg_models.errors import CheckpointError
from bsg_models.model import BeliefModel


def make_optimiser(model: BeliefModel, training: TrainingConfig) -> torch.optim.Adam:
    """Return Adam with the paper's learning rate, and its decay if read as weight decay."""
    decay = training.decay if training.decay_as == "weight-decay" else 0.0
    return torch.optim.Adam(model.parameters(), lr=training.learning_rate, weight_decay=decay)


def learning_rate(training: TrainingConfig, step: int) -> float:
    """Return the learning rate of a step, counted from 0.

    >>> learning_rate(TrainingConfig(decay=0.5, decay_as="learning-rate"), 2)
    0.005
    """
    if training.decay_as == "weight-decay":
        return training.learning_rate
    return training.learning_rate / (1 + training.decay * step)


def optimiser_state(optimiser: torch.optim.Adam, model: BeliefModel) -> dict[str, torch.Tensor]:
    """Return Adam's state by the names of the parameters."""
    return {
        f"{name}.{key}": torch.as_tensor(value)
        for name, parameter in model.named_parameters()
        for key, value in optimiser.state[parameter].items()
    }


def load_optimiser(
    optimiser: torch.optim.Adam, model: BeliefModel, state: dict[str, torch.Tensor], *, path: Path
) -> None:
    """Give Adam back what `optimiser_state` took from it.

    Raises:
        CheckpointError: if a tensor is missing or of another shape.
    """
    for name, parameter in model.named_parameters():
        for key, shape in (
            ("step", torch.Size()),
            ("exp_avg", parameter.shape),
            ("exp_avg_sq", parameter.shape),
        ):
            found = state.get(f"{name}.{key}")
            if found is None or found.shape != shape:
                raise CheckpointError(f"{path}: adam.{name}.{key} is missing or of another shape")
            optimiser.state[parameter][key] = found.clone()
