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
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True)
    assert (done.returncode, "torch.jit.script" in done.stderr) == (0, False)
    assert "FutureWarning: another" in done.stderr


def test_a_filter_of_the_user_goes_first() -> None:
    command = [sys.executable, "-W", "error::FutureWarning", "-c", CODE]
    done = subprocess.run(command, capture_output=True, text=True)
    assert "FutureWarning: `torch.jit.script` is deprecated" in done.stderr
