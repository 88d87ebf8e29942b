"""The shipped models are listed without torch, and the list is that of their checkpoints."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from bsg_data.inputs.bounded_file import hash_file
from bsg_models.errors import CheckpointError
from bsg_models.runs.model_card import summarise_model
from bsg_models.runs.model_facts import list_shipped
from bsg_models.runs.shipped import encode_sums, shipped_names


def test_shipped_models_are_listed_in_their_order(shipped: Path) -> None:
    first, second = list_shipped()
    assert (first.name, second.name) == ("universal", "other")
    assert first.data == "12 buildings of synthetic"
    assert first.licence == "Apache-2.0"
    assert first.sha256 == hash_file(shipped / "universal.safetensors")
    assert (first.zoo_name, first.class_space, first.classes) == ("gamma-poisson", "hm3d45-v2", 45)


def test_the_list_has_what_the_checkpoints_say() -> None:
    """Only the configuration may lack settings: those that are newer than the file."""
    for listed, name in zip(list_shipped(), shipped_names(), strict=True):
        summary = summarise_model(name)
        assert listed.model_copy(update={"config": summary.config}) == summary
        assert has_all(summary.config, listed.config)


def has_all(now: Any, stored: Any) -> bool:
    if isinstance(stored, dict):
        return all(has_all(now[name], value) for name, value in stored.items())
    return bool(now == stored)


def test_a_changed_model_is_not_listed(shipped: Path) -> None:
    with (shipped / "other.safetensors").open("ab") as file:
        file.write(b" ")
    with pytest.raises(CheckpointError, match=r"other\.safetensors: is not what was shipped"):
        list_shipped()


def test_a_file_that_is_no_checkpoint_is_not_listed(shipped: Path) -> None:
    text = b'{"__metadata__": {}}'
    path = shipped / "other.safetensors"
    path.write_bytes(len(text).to_bytes(8, "little") + text)
    (shipped / "SHA256SUMS").write_text(encode_sums(shipped, ("universal", "other")))
    with pytest.raises(CheckpointError, match=r"other\.safetensors: its header is not"):
        list_shipped()


def test_the_command_lists_them_without_slow_imports() -> None:
    slow = ("matplotlib", "pandas", "pyarrow", "scipy", "torch")
    lines = (
        "import sys\n"
        f"for name in {slow}: sys.modules[name] = None\n"  # any import of them raises now
        "from bsg_cli.models import main\n"
        "main(['list'])\n"
    )
    done = subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].startswith("universal ")
