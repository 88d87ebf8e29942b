"""Beliefs: what follows from the facts of `bsg_data`. Needs a dataset, never HM3D itself."""

from bsg_models.belief.belief_graph import BeliefGraph, believe
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.formats import FORMATS, FormatRow, read_belief, write_belief
from bsg_models.belief.hydra import read_hydra, read_hydra_belief, write_hydra
from bsg_models.belief.network import from_networkx, to_networkx
from bsg_models.belief.tables import read_tables, write_tables
from bsg_models.inputs.graphs import MaskedGraphs
from bsg_models.rendering.explorer import View, write_explorer
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.predictor import Predictor
from bsg_models.search.planners import PLANNERS, Knowledge, next_room
from bsg_models.studies.comparison import compare_runs
from bsg_models.studies.search_cases import StudyRecipe
from bsg_models.studies.search_study import study_search
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import BASELINES, ZOO, find_config, make_model
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import BeliefModel

__all__ = [
    "BASELINES",
    "FORMATS",
    "PLANNERS",
    "ZOO",
    "BeliefGraph",
    "BeliefModel",
    "Expectation",
    "FormatRow",
    "Knowledge",
    "MaskedGraphs",
    "Predictor",
    "RunConfig",
    "StudyRecipe",
    "View",
    "believe",
    "compare_runs",
    "find_config",
    "from_networkx",
    "load_checkpoint",
    "make_model",
    "next_room",
    "read_belief",
    "read_hydra",
    "read_hydra_belief",
    "read_tables",
    "restore_model",
    "study_search",
    "to_networkx",
    "train_run",
    "write_belief",
    "write_explorer",
    "write_hydra",
    "write_tables",
]
