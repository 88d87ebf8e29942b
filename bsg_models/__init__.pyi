from .belief.annotation import annotate_hydra
from .belief.belief_graph import BeliefGraph, believe
from .belief.count_distribution import CountDistribution
from .belief.document import to_networkx
from .belief.expectation import Expectation
from .belief.formats import FORMATS, FormatRow, read_belief, write_belief
from .belief.graph_file import read_graph
from .ceci.masked_graphs import MaskedGraphs
from .ceci.network import Network
from .errors import (
    BeliefFileError,
    CheckpointError,
    ConfigError,
    HydraError,
    PredictionError,
    TrainingError,
)
from .inputs.folds import scenes_of
from .inputs.graphs import read_split, to_pyg
from .robot.answers import EXPLORE, ExpectedClass, Place, RoomKind, Step
from .robot.seen_building import SeenBuilding, open_graph
from .robot.ways import Ways
from .robot.words import Meaning, set_hidden_shares
from .runs.checkpoint import load_checkpoint, restore_model
from .runs.found_model import DEFAULT_MODEL, download
from .runs.hub import HubModel
from .runs.predictor import Predictor
from .search.catalogue import Planner
from .search.knowledge import Knowledge
from .search.planners import next_room
from .studies.comparison import Comparison
from .studies.evaluation_report import metric_rows
from .studies.leaderboard import Leaderboard, LeaderboardRecipe, make_leaderboard
from .studies.search_request import StudyRecipe
from .studies.search_study import study_search
from .training.training import train_run
from .zoo.config import find_config
from .zoo.model import BeliefModel
from .zoo.settings import DataConfig, ModelConfig, TrainingConfig

__all__ = [
    "DEFAULT_MODEL",
    "EXPLORE",
    "FORMATS",
    "BeliefFileError",
    "BeliefGraph",
    "BeliefModel",
    "CheckpointError",
    "Comparison",
    "ConfigError",
    "CountDistribution",
    "DataConfig",
    "Expectation",
    "ExpectedClass",
    "FormatRow",
    "HubModel",
    "HydraError",
    "Knowledge",
    "Leaderboard",
    "LeaderboardRecipe",
    "MaskedGraphs",
    "Meaning",
    "ModelConfig",
    "Network",
    "Place",
    "Planner",
    "PredictionError",
    "Predictor",
    "RoomKind",
    "SeenBuilding",
    "Step",
    "StudyRecipe",
    "TrainingConfig",
    "TrainingError",
    "Ways",
    "annotate_hydra",
    "believe",
    "download",
    "find_config",
    "load_checkpoint",
    "make_leaderboard",
    "metric_rows",
    "next_room",
    "open_graph",
    "read_belief",
    "read_graph",
    "read_split",
    "restore_model",
    "scenes_of",
    "set_hidden_shares",
    "study_search",
    "to_networkx",
    "to_pyg",
    "train_run",
    "write_belief",
]
