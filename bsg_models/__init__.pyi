from .belief.belief_files import (
    BeliefFileError,
    from_networkx,
    read_belief,
    read_tables,
    to_networkx,
    write_belief,
    write_tables,
)
from .belief.belief_graph import BeliefGraph, BlindNode, believe, rank_unseen
from .belief.count_distribution import CountDistribution
from .belief.expectation import Expectation
from .belief.hydra import HydraError, read_hydra, read_hydra_belief, write_hydra
from .errors import CheckpointError, ConfigError, TrainingError
from .evaluation.measurement import Estimate
from .inputs.graphs import MaskedGraphs
from .rendering.explorer import View, write_explorer
from .runs.checkpoint import Checkpoint, load_checkpoint, restore_model
from .runs.predictor import Predictor
from .search.planners import PLANNERS, Knowledge, Planner, next_room
from .search.room_graphs import RoomGraph, WorldRecipe
from .search.shortest_paths import Travel
from .search.simulator import Outcome
from .studies.comparison import Comparison, compare_runs
from .studies.leaderboard import Leaderboard, LeaderboardRecipe, ModelResult, make_leaderboard
from .studies.search_cases import StudyRecipe
from .studies.search_study import Searches, Study, study_search
from .training.learning_curve import EpochReport
from .training.training import train_run
from .zoo.catalogue import BASELINES, ZOO, find_config, make_model
from .zoo.config import RunConfig
from .zoo.model import BeliefModel

__all__ = [
    "BASELINES",
    "PLANNERS",
    "ZOO",
    "BeliefFileError",
    "BeliefGraph",
    "BeliefModel",
    "BlindNode",
    "Checkpoint",
    "CheckpointError",
    "Comparison",
    "ConfigError",
    "CountDistribution",
    "EpochReport",
    "Estimate",
    "Expectation",
    "HydraError",
    "Knowledge",
    "Leaderboard",
    "LeaderboardRecipe",
    "MaskedGraphs",
    "ModelResult",
    "Outcome",
    "Planner",
    "Predictor",
    "RoomGraph",
    "RunConfig",
    "Searches",
    "Study",
    "StudyRecipe",
    "TrainingError",
    "Travel",
    "View",
    "WorldRecipe",
    "believe",
    "compare_runs",
    "find_config",
    "from_networkx",
    "load_checkpoint",
    "make_leaderboard",
    "make_model",
    "next_room",
    "rank_unseen",
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
