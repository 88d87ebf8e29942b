"""The bounds of what comes by the network: robots' maps, Hydra's graphs, saved beliefs.

They are far above all real ones, and low enough for a machine with 2 GB. A file that a user opens
has none: it costs time and memory in proportion to its size.
"""

from __future__ import annotations

_MIB = 2**20

ROBOT = 64 * _MIB  # bytes of a robot's graph, JSON
SPARK_DSG = 256 * _MIB  # of Hydra's graph, JSON or binary
BELIEF = 256 * _MIB  # of a belief graph, JSON
MAX_VALUES = 6_000_000  # lists, objects and what commas part; twice what our largest graphs have
MAX_GRAPH_NODES, MAX_GRAPH_EDGES = 200_000, 1_000_000  # of Hydra's graph, of all layers
MAX_GRAPH_LABELS = 100_000  # of a layer of it, named
MAX_ROBOT_ROOMS = 3_000  # a model takes about 100 kB for each where their shares are not known
MAX_ROBOT_OBJECTS = 50_000  # each takes a kilobyte while a graph is read
MAX_ROBOT_LETTERS = 1_000_000  # of its words for objects, each word once: each is read by rules
MAX_ROBOT_WORDS = 10_000  # of its detector; the largest published vocabulary has some thousands
MAX_ROBOT_PAIRS = 100_000  # of connected rooms; 3,000 rooms of a building have some 6,000
MAX_ROBOT_TYPES = 150_000  # labels of the types of all rooms; a classifier has 60 to 400
MAX_ROBOT_KINDS = 5_000  # different ones of these
MAX_UNREAD = 1_000  # words of a room's type that nobody could read; a type has so many labels
MAX_ROBOT_CUSTOMS = 1_000  # that people said
MAX_ROBOT_LOOKS = 2_000  # that found nothing
MAX_ROBOT_SOUGHT = 100  # different things of these looks: each is compared with all that was seen
MAX_CORNERS = 256  # of a footprint
MAX_ALL_CORNERS = 200_000  # of all footprints of a graph: those that cross themselves are slow
