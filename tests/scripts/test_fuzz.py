"""The fuzzer feeds a reader, and keeps the input that fails."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import load_script

pytest.importorskip("atheris", reason="the extra `fuzz` is not installed")


@pytest.mark.heavy
def test_a_reader_is_fed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["--targets", "annotation", "--runs", "300", "--corpus", str(tmp_path)]
    assert load_script("faults/fuzz").main(argv) == 0
    assert "failed: none" in capsys.readouterr().out
    assert list((tmp_path / "corpus" / "annotation").iterdir())
    assert not list((tmp_path / "findings").iterdir())
