"""`bsg_models` hides one warning that no user can act on, unless the user wants it."""

from __future__ import annotations

import subprocess
import sys

CODE = """
import warnings

import bsg_models

warnings.warn("`torch.jit.script` is deprecated. Use another.", FutureWarning)
warnings.warn("another", FutureWarning)
"""


def test_one_warning_is_hidden_and_no_other() -> None:
    for filters, is_hidden in (((), True), (("-W", "error::FutureWarning"), False)):
        command = [sys.executable, *filters, "-c", CODE]
        done = subprocess.run(command, capture_output=True, text=True)
        assert ("torch.jit.script" not in done.stderr) == is_hidden
        assert ("FutureWarning: another" in done.stderr) == is_hidden  # an error comes first
