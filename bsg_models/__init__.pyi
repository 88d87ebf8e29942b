from .belief.annotation import annotate_hydra
from .belief.belief_graph import BeliefGraph, BlindNode, believe, rank_unseen
from .belief.count_distribution import CountDistribution
from .belief.document import to_networkx
from .belief.expectation import Expectation
from .belief.formats import FORMATS, FormatRow, read_belief, write_belief
from .belief.graph_file import read_graph
from .errors import (
    BeliefFileError,
    CheckpointError,
    ConfigError,
    HydraError,
    PredictionError,
    TrainingError,
)
from .evaluation.bootstrap import Bootstrap, Estimate
from .evaluation.verdict import explain
from .inputs.folds import scenes_of
from .inputs.graphs import MaskedGraphs, read_split, to_graph
from .inputs.whole_buildings import to_pyg
from .rendering.explorer import ShownBelief, write_explorer
from .robot.answers import EXPLORE, ExpectedClass, Place, Step
from .robot.seen_building import SeenBuilding, open_graph
from .robot.ways import Ways
from .robot.words import Meaning, set_hidden_shares
from .runs.checkpoint import Checkpoint, load_checkpoint, restore_model
from .runs.found_model import (
    DEFAULT_MODEL,
    FoundModel,
    download,
    find_model,
    locate_run,
    shipped_names,
)
from .runs.hub import HubModel
from .runs.model_summary import (
    ModelSummary,
    list_shipped,
    summarise_model,
)
from .runs.predictor import Predictor
from .runs.run_log import Begun, Ended, read_log
from .search.catalogue import PLANNERS, Planner
from .search.knowledge import Knowledge, Travel
from .search.planners import next_room
from .search.room_graphs import RoomGraph, WorldRecipe
from .studies.belief_report import (
    BeliefReport,
    BeliefRequest,
    RoomBelief,
    report_beliefs,
)
from .studies.comparison import Comparison, EvaluationRequest, compare_runs
from .studies.evaluation_report import (
    EvaluationReport,
    headline_rows,
    metric_rows,
    report_evaluation,
)
from .studies.leaderboard import (
    Leaderboard,
    LeaderboardRecipe,
    ModelResult,
    make_leaderboard,
)
from .studies.leaderboard_report import (
    LeaderboardReport,
    refuse_finished,
    report_leaderboard,
    summary_rows,
)
from .studies.run_summary import RunSummary, plot_run, summarise_run
from .studies.savings import Saving, WorldResult, tabulate_savings
from .studies.sealed_results import check_results
from .studies.search_report import SearchReport, report_search
from .studies.search_request import SearchRequest, StudyRecipe, choose_default_run
from .studies.search_study import Study, study_search
from .training.learning_curve import EpochReport
from .training.onnx_file import export_onnx
from .training.training import train_run
from .zoo.catalogue import BASELINES, ZOO
from .zoo.config import RunConfig, find_config, override, read_config, validate_config, write_toml
from .zoo.ensemble import make_model
from .zoo.model import BeliefModel
from .zoo.settings import DataConfig, ModelConfig, TrainingConfig

__all__ = [
    "BASELINES",
    "DEFAULT_MODEL",
    "EXPLORE",
    "FORMATS",
    "PLANNERS",
    "ZOO",
    "Begun",
    "BeliefFileError",
    "BeliefGraph",
    "BeliefModel",
    "BeliefReport",
    "BeliefRequest",
    "BlindNode",
    "Bootstrap",
    "Checkpoint",
    "CheckpointError",
    "Comparison",
    "ConfigError",
    "CountDistribution",
    "DataConfig",
    "Ended",
    "EpochReport",
    "Estimate",
    "EvaluationReport",
    "EvaluationRequest",
    "Expectation",
    "ExpectedClass",
    "FormatRow",
    "FoundModel",
    "HubModel",
    "HydraError",
    "Knowledge",
    "Leaderboard",
    "LeaderboardRecipe",
    "LeaderboardReport",
    "MaskedGraphs",
    "Meaning",
    "ModelConfig",
    "ModelResult",
    "ModelSummary",
    "Place",
    "Planner",
    "PredictionError",
    "Predictor",
    "RoomBelief",
    "RoomGraph",
    "RunConfig",
    "RunSummary",
    "Saving",
    "SearchReport",
    "SearchRequest",
    "SeenBuilding",
    "ShownBelief",
    "Step",
    "Study",
    "StudyRecipe",
    "TrainingConfig",
    "TrainingError",
    "Travel",
    "Ways",
    "WorldRecipe",
    "WorldResult",
    "annotate_hydra",
    "believe",
    "check_results",
    "choose_default_run",
    "compare_runs",
    "download",
    "explain",
    "export_onnx",
    "find_config",
    "find_model",
    "headline_rows",
    "list_shipped",
    "load_checkpoint",
    "locate_run",
    "make_leaderboard",
    "make_model",
    "metric_rows",
    "next_room",
    "open_graph",
    "override",
    "plot_run",
    "rank_unseen",
    "read_belief",
    "read_config",
    "read_graph",
    "read_log",
    "read_split",
    "refuse_finished",
    "report_beliefs",
    "report_evaluation",
    "report_leaderboard",
    "report_search",
    "restore_model",
    "scenes_of",
    "set_hidden_shares",
    "shipped_names",
    "study_search",
    "summarise_model",
    "summarise_run",
    "summary_rows",
    "tabulate_savings",
    "to_graph",
    "to_networkx",
    "to_pyg",
    "train_run",
    "validate_config",
    "write_belief",
    "write_explorer",
    "write_toml",
]
