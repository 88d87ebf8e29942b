from .answers.place import EXPLORE, ExpectedClass, Habit, Place, RoomKind, Step
from .answers.seen_building import SeenBuilding, open_graph
from .answers.ways import Ways
from .answers.words import Meaning, set_hidden_shares
from .errors import BeliefFileError, HydraError
from .graph.annotation import annotate_hydra
from .graph.document import to_networkx
from .graph.formats import FORMATS, FormatRow, read_belief, write_belief
from .graph.graph_file import read_graph
from .graph.robot_json import read_robot_graph

__all__ = [
    "EXPLORE",
    "FORMATS",
    "BeliefFileError",
    "ExpectedClass",
    "FormatRow",
    "Habit",
    "HydraError",
    "Meaning",
    "Place",
    "RoomKind",
    "SeenBuilding",
    "Step",
    "Ways",
    "annotate_hydra",
    "open_graph",
    "read_belief",
    "read_graph",
    "read_robot_graph",
    "set_hidden_shares",
    "to_networkx",
    "write_belief",
]
