"""The largest accepted size of every kind of file.

`bsg_data.inputs.bounded_file` reads untrusted files within these bounds. They are far above all
real files, and low enough for a machine with 2 GB.
"""

from __future__ import annotations

from dataclasses import dataclass

KIB, MIB, GIB = 2**10, 2**20, 2**30


@dataclass(frozen=True, slots=True)
class Bound:
    """How much of a file is read."""

    what: str  # the kind of file, in words
    bytes: int  # that it may have, packed and unpacked
    items: str = ""  # what else is counted, in words; empty where bytes say all


MAX_ROWS = 10_000_000  # of a parquet file
MAX_STREAMED_ROWS = 100_000_000  # of a parquet file that is read by row groups
MAX_OBJECT_ROWS = 2_500_000  # of a table that is a source: 25 times HM3D's objects
MAX_PARTS = 100_000  # of a table of a dataset; the names of the files number no more
MAX_NESTING = 100  # of lists and mappings in YAML; JSON ends at 200
MAX_LINE = MIB  # characters of a line of CSV
MAX_RATIO = 200  # of a packed stream that is read piece by piece; text is packed to a tenth

_HOUSES = "a house of 4 MiB and 1,000 rooms"
_NESTED_YAML = f"nested {MAX_NESTING} deep; a key once"
_NESTED = "nested 200 deep; a key once"

ANNOTATION = Bound("annotation of HM3DSem, `*.semantic.txt`", 64 * MIB)
STATISTICS = Bound("zip of HM3DSem's statistics", 16 * MIB)
SYNTHETIC = Bound("mark of synthetic buildings, `synthetic.json`", 64 * KIB, _NESTED)
LAYOUT = Bound("room layout, YAML", MIB, _NESTED_YAML)
LABEL_SPACE = Bound("label space, YAML or CSV", 4 * MIB, _NESTED_YAML)
MESH = Bound(
    "mesh, GLB",
    512 * MIB,
    "10,000,000 triangles, 8,192 texels a side, 32 MiB of JSON; all in this file",
)
HOUSE = Bound("house of Matterport3D, `.house`", 256 * MIB)
MAX_HOUSE = 4 * MIB  # of ProcTHOR; the largest of 150 real houses has 84 kB
MAX_HOUSE_ROOMS = 1_000
PROCTHOR = Bound("houses of ProcTHOR, a JSON array", 512 * MIB, _HOUSES)
PROCTHOR_LINES = Bound(
    "houses of ProcTHOR, JSON lines", 16 * GIB, f"{_HOUSES}; packed {MAX_RATIO} to 1 at most"
)
MAX_SHEET_ROWS = 1_000_000  # of a sheet of a spreadsheet
MAX_SHEET_COLUMNS = 64
MAX_CELLS = 10_000_000  # of a sheet, that are not empty
MAX_CELL = 32_767  # letters of a cell; no program writes more
COBIE = Bound(
    "COBie spreadsheet, `.xlsx`",
    256 * MIB,
    f"{MAX_SHEET_ROWS:,} rows, {MAX_SHEET_COLUMNS} columns and {MAX_CELLS:,} cells of a sheet",
)
S3DIS = Bound("list of labels of S3DIS, JSON", 64 * MIB, _NESTED)
BEHAVIOR = Bound("list of BEHAVIOR's rooms, JSON", 64 * MIB, _NESTED)
TABLE = Bound(
    "table of objects, CSV or parquet",
    4 * GIB,
    f"{MAX_OBJECT_ROWS:,} rows; lines of {MAX_LINE:,} characters; packed {MAX_RATIO} to 1 at most",
)
MAX_ROBOT_ROOMS = 10_000  # a model takes about 100 kB for each where their shares are not known
MAX_ROBOT_OBJECTS = 100_000  # each takes a kilobyte while a graph is read
_ROOMS = f"{_NESTED}; {MAX_ROBOT_ROOMS:,} rooms, {MAX_ROBOT_OBJECTS:,} objects"
ROBOT = Bound("robot's graph, JSON", 64 * MIB, _ROOMS)
SPARK_DSG = Bound("Spark-DSG graph, JSON or binary", 256 * MIB, _ROOMS)
BELIEF = Bound("belief graph, JSON", 256 * MIB, _NESTED)
CLASS_MAP = Bound("class map, each CSV file", 16 * MIB, "256 classes")
MANIFEST_FILE = Bound(
    "manifest, plan and reports of a dataset, JSON",
    64 * MIB,
    f"{_NESTED}; {MAX_PARTS:,} parts of {MAX_ROWS:,} scenes",
)
DATASET_CARD = Bound("card and description of a dataset, Markdown and JSON", 256 * MIB)
DATASET_TABLE = Bound(
    "parquet file of a dataset, of beliefs or of predictions",
    4 * GIB,
    f"the rows that the manifest says; {MAX_ROWS:,} rows",
)
CONFIG = Bound("configuration, TOML", 64 * KIB)
CHECKPOINT = Bound(
    "checkpoint, safetensors",
    4 * GIB,
    "16 MiB of header",
)
CHECKPOINT_HEADER = Bound("header of a checkpoint", 16 * MIB)
PRIOR = Bound("prior table, JSON", 16 * MIB, _NESTED)
RESULTS = Bound("results of an evaluation or a search, JSON", 256 * MIB, _NESTED)
RUN_RECORD = Bound("log, metrics, seconds and figures of a run", 16 * MIB, _NESTED)
CARD = Bound("card of a model, Markdown with YAML", MIB, _NESTED)
CHECKSUMS = Bound("list of checksums, `SHA256SUMS`", MIB)
