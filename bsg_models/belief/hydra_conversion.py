"""Convert binary graphs of Hydra in a separate process with limits.

Their C++ reader trusts the lengths in a file: a kilobyte can ask for all memory, which no exception
stops. A process has limits, and only the process ends when it reaches them.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

from bsg_data.errors import ask_to_install
from bsg_models.errors import HydraError

BINARY = ".sparkdsg"
_MEMORY = 4 * 2**30  # bytes, besides Python and spark_dsg; a real graph takes a tenth
_SECONDS = 120
_CODE = (
    "import sys; path, written, *sys.path = sys.argv[1:]\n"
    "from bsg_models.belief.hydra_conversion import run\n"
    "run(path, written)\n"
)


def convert(path: Path) -> bytes:
    """Return the JSON of a binary graph, as spark_dsg makes it."""
    if importlib.util.find_spec("spark_dsg") is None:
        raise HydraError(
            f"{path}: binary graphs need spark-dsg; save the graph as .json, or "
            f"{ask_to_install('hydra')}",
            code="library-missing",
            where=path,
        )
    with tempfile.TemporaryDirectory() as folder:  # the writer chooses names, and fails silently
        written = Path(folder, "graph.json")
        # Isolated: never import modules from the working directory.
        command = [sys.executable, "-I", "-c", _CODE, str(path.absolute()), str(written), *sys.path]
        try:
            subprocess.run(  # noqa: S603
                command, check=True, capture_output=True, timeout=2 * _SECONDS, cwd=folder
            )
            return written.read_bytes()
        except (subprocess.SubprocessError, OSError) as error:
            raise HydraError(
                f"{path}: expected a Spark-DSG file, found one that spark_dsg cannot load within "
                f"{_MEMORY // 2**30} GiB and {_SECONDS} s; save the graph as .json",
                code="binary-unloadable",
                where=path,
            ) from error


def run(path: str, written: str) -> None:
    """Convert a graph in this process, which is limited from now on."""
    import spark_dsg

    _bound()
    spark_dsg.DynamicSceneGraph.load(path).save(written, include_mesh=True)


def _bound() -> None:
    try:
        import resource
    except ImportError:  # not on Windows: there the caller's timeout is the only limit
        return
    status = Path("/proc/self/statm")
    taken = int(status.read_text().split()[0]) * resource.getpagesize() if status.exists() else 0
    resource.setrlimit(resource.RLIMIT_AS, (taken + _MEMORY, taken + _MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (_SECONDS, _SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
