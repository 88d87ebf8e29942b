"""Nothing is left in the temporary directory by a command that is done with it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tally import Tally

MAKE_EVERY_MODEL = """
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import find_config
from bsg_models.zoo.construction import make_model

for name in ZOO:
    make_model(find_config(name), classes=3)
print(len(list(ZOO)))
"""


def test_no_model_leaves_a_file_in_the_temporary_directory(tmp_path: Path, tally: Tally) -> None:
    done = subprocess.run(
        [sys.executable, "-c", MAKE_EVERY_MODEL],
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    left = [str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()]
    tally(
        test="files left in the temporary directory",
        command="making every model of the zoo",
        tried=int(done.stdout),
        survived=max(int(done.stdout) - len(left), 0),
        misses=tuple(left),
    )
    assert left == []
