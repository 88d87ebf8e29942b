"""The bounds of every kind of file: bytes, packed and unpacked, and numbers of what is in it.

`bsg_data.inputs.bounded_file` reads untrusted files within these bounds. They are far above all
real files, and low enough for a machine with 2 GB.
"""

from __future__ import annotations

KIB, MIB, GIB = 2**10, 2**20, 2**30

MAX_NESTING = 100  # of lists and mappings in YAML; JSON ends at 200
MAX_NODES = 500_000  # texts, lists and mappings in YAML: each takes kilobytes while it is parsed
# In JSON, before it is parsed: text of two bytes becomes an object of two hundred. Both bounds are
# twice what the largest graphs of ours have; commas and brackets in strings count, too.
MAX_CONTAINERS = 1_500_000  # objects and lists
MAX_VALUES = 6_000_000  # these, and what commas part
MAX_KEYS = 1_000_000  # where a key must not be there twice: they are read one by one
MAX_RATIO = 200  # of a packed stream that is read piece by piece; text is packed to a tenth

# sources
ANNOTATION = 64 * MIB  # of HM3DSem, `*.semantic.txt`
MAX_INSTANCES = 500_000  # of such an annotation; the largest real one has 2,900
STATISTICS = 16 * MIB  # of HM3DSem, a zip
SYNTHETIC = 64 * KIB  # the mark of synthetic buildings, `synthetic.json`
LAYOUT = MIB  # of rooms, YAML
LABEL_SPACE = 4 * MIB  # YAML or CSV
LABEL_TABLE = 16 * MIB  # of labels of rooms, CSV
MAX_LABEL_ROWS = 500_000  # of this table, and of a label space; HM3D has 4,000 rooms
MAX_LABEL_COLUMNS = 1_000  # of these, and of a class map
HOUSE = 256 * MIB  # of Matterport3D, `.house`
MAX_HOUSE_LINES = 1_000_000  # of it; real ones have 30,000
MAX_HOUSE_PARTS = 50_000  # lines of a kind that is read: objects, corners, surfaces, portals, names
PROCTHOR, PROCTHOR_LINES = 512 * MIB, 16 * GIB  # houses of ProcTHOR: a JSON array, JSON lines
MAX_HOUSE = 4 * MIB  # of ProcTHOR; the largest of 150 real houses has 84 kB
MAX_HOUSE_ROOMS = 1_000  # and of any building whose rooms are connected by their boxes
MAX_HOUSE_THINGS = 10_000  # objects with what is in them, doors, walls; 150 real houses have 220
MAX_CORNERS = 256  # of a floor or a footprint
MAX_ALL_CORNERS = 200_000  # of all footprints of a graph: those that cross themselves are slow
COBIE = 256 * MIB  # a spreadsheet, `.xlsx`
MAX_SHEET_ROWS = 1_000_000  # of a sheet of a spreadsheet
MAX_SHEET_COLUMNS = 64
MAX_SHEET_ROOMS = 20_000  # spaces of a building; a large hospital has 8,000
MAX_CELLS = 1_000_000  # of the sheets that are read, that are not empty
MAX_CELL = 32_767  # letters of a cell; no program writes more
MAX_LETTERS = 32_000_000  # of all these cells, and of the texts that cells share
MAX_MEMBERS = 10_000  # files in the spreadsheet, which is a zip
SHEET_LIST = 16 * MIB  # of these, unpacked, the lists of sheets and of files
MAX_ELEMENTS = 6_000_000  # of the XML that is read; a cell has two or three
MAX_TAG = MIB  # bytes of a tag of XML
MAX_ATTRIBUTES = 100  # of a tag; the standard's longest have some twenty
MAX_NAMES, MAX_NAME = 1_000, 255  # different ones of elements and attributes, letters of each
S3DIS = BEHAVIOR = 64 * MIB  # lists of labels and of rooms, JSON
MAX_LISTED = 100_000  # rooms and objects of such a list; the longest real one has 36,538
MAX_LISTED_SCENES = 1_000  # of such a list; the longest real one has 51
TABLE = 512 * MIB  # of objects, CSV, or parquet as it unpacks
MAX_LETTERS_OF_OBJECTS = 6_000_000  # of their names in a building or a table, each name once
MAX_OBJECT_ROWS = 1_500_000  # of such a table: 15 times HM3D's objects
MAX_LINE = MIB  # characters of a line of CSV, bytes of one of a house

# robots
ROBOT = 64 * MIB  # a robot's graph, JSON
SPARK_DSG = 256 * MIB  # JSON or binary
MAX_GRAPH_NODES, MAX_GRAPH_EDGES = 200_000, 1_000_000  # of Hydra's graph, of all layers
MAX_GRAPH_LABELS = 100_000  # of a layer of it, named
BELIEF = 256 * MIB  # a belief graph, JSON
MAX_ROBOT_ROOMS = 3_000  # a model takes about 100 kB for each where their shares are not known
MAX_ROBOT_OBJECTS = 50_000  # each takes a kilobyte while a graph is read
MAX_ROBOT_LETTERS = 1_000_000  # of its words for objects, each word once: each is read by rules
MAX_ROBOT_WORDS = 10_000  # of its detector; the largest published vocabulary has some thousands
MAX_ROBOT_PAIRS = 100_000  # of connected rooms; 3,000 rooms of a building have some 6,000
MAX_ROBOT_TYPES = 150_000  # labels of the types of all rooms; a classifier has 60 to 400
MAX_ROBOT_KINDS = 5_000  # different ones of these
MAX_UNREAD = 1_000  # words of a room's type that nobody could read; a type has so many labels
MAX_ROBOT_LOOKS = 2_000  # that found nothing
MAX_ROBOT_SOUGHT = 100  # different things of these looks: each is compared with all that was seen

# our own files
CLASS_MAP = 2 * MIB  # each of its CSV files; a word of it takes kilobytes, for typos
MAX_MAP_ROWS = 50_000  # of these; the published maps have 2,600
MANIFEST_FILE = 64 * MIB  # the manifest, the plan or a report of a dataset, JSON
DATASET_TABLE = 4 * GIB  # a parquet file of a dataset, of beliefs or of predictions
MAX_ROWS = 10_000_000  # of a parquet file
MAX_STREAMED_ROWS = 100_000_000  # of a parquet file that is read by row groups
MAX_SHARDS = 100_000  # of a dataset; the names of the files number no more
CONFIG = 64 * KIB  # TOML
MAX_TOML_LINE = 4_096  # characters; the parser takes the square of the parts of a key
CHECKPOINT, CHECKPOINT_HEADER = 4 * GIB, 16 * MIB  # safetensors
RESULTS = 256 * MIB  # of an evaluation or a search, JSON
RUN_RECORD = 16 * MIB  # `training.json`
CARD = MIB  # of a model, Markdown with YAML
