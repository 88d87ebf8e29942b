"""Beliefs: what follows from the facts of `bsg_data`. Needs a dataset, never HM3D itself."""

from bsg_models.checkpoint import load_checkpoint, restore_model
from bsg_models.comparison import compare_runs
from bsg_models.config import RunConfig
from bsg_models.expectation import Expectation
from bsg_models.graph_dataset import MaskedGraphs
from bsg_models.model import BeliefModel
from bsg_models.training import train_run
from bsg_models.zoo import BASELINES, ZOO, find_config, make_model

__all__ = [
    "BASELINES",
    "ZOO",
    "BeliefModel",
    "Expectation",
    "MaskedGraphs",
    "RunConfig",
    "compare_runs",
    "find_config",
    "load_checkpoint",
    "make_model",
    "restore_model",
    "train_run",
]
