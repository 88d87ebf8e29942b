import bsg_robot

from .belief.belief_graph import BeliefGraph, believe
from .belief.count_distribution import CountDistribution
from .belief.expectation import Expectation
from .belief.hidden_share import estimate_hidden_share
from .belief.masked_graph import mask_scene
from .belief.partial_graph import KnownRoom, Look, PartialGraph, SeenObject
from .ceci.masked_graphs import MaskedGraphs
from .ceci.network import Network
from .errors import (
    CheckpointError,
    ConfigError,
    PredictionError,
    TrainingError,
)
from .inputs.folds import scenes_of
from .inputs.graphs import read_split, to_pyg
from .runs.checkpoint import load_checkpoint, restore_model
from .runs.found_model import DEFAULT_MODEL, download
from .runs.hub import HubModel
from .runs.predictor import Predictor
from .search.catalogue import Planner
from .search.knowledge import Knowledge
from .search.planners import next_room
from .studies.leaderboard import Leaderboard, LeaderboardRecipe, make_leaderboard
from .studies.search_request import StudyRecipe
from .studies.search_study import study_search
from .training.training import train_run
from .zoo.config import find_config
from .zoo.model import BeliefModel
from .zoo.settings import DataConfig, ModelConfig, TrainingConfig

open_graph = bsg_robot.open_graph  # lazy_loader reads relative imports alone
write_belief = bsg_robot.write_belief

__all__ = [
    "DEFAULT_MODEL",
    "BeliefGraph",
    "BeliefModel",
    "CheckpointError",
    "ConfigError",
    "CountDistribution",
    "DataConfig",
    "Expectation",
    "HubModel",
    "Knowledge",
    "KnownRoom",
    "Leaderboard",
    "LeaderboardRecipe",
    "Look",
    "MaskedGraphs",
    "ModelConfig",
    "Network",
    "PartialGraph",
    "Planner",
    "PredictionError",
    "Predictor",
    "SeenObject",
    "StudyRecipe",
    "TrainingConfig",
    "TrainingError",
    "believe",
    "download",
    "estimate_hidden_share",
    "find_config",
    "load_checkpoint",
    "make_leaderboard",
    "mask_scene",
    "next_room",
    "open_graph",
    "read_split",
    "restore_model",
    "scenes_of",
    "study_search",
    "to_pyg",
    "train_run",
    "write_belief",
]
