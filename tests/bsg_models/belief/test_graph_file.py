from __future__ import annotations

from pathlib import Path

import pytest
from conftest import REPOSITORY

from bsg_data.errors import BSGError, RecipeError
from bsg_data.observation.robot_json import read_robot_graph
from bsg_models.belief.graph_file import read_graph

OFFICE = REPOSITORY / "docs" / "office.json"


def test_our_own_graph_is_known_by_its_content(tmp_path: Path) -> None:
    assert read_graph(OFFICE) == read_robot_graph(OFFICE)
    with pytest.raises(RecipeError, match="labels are for Hydra's graphs"):
        read_graph(OFFICE, labels="ade20k")
    with pytest.raises(BSGError, match="cannot be read"):
        read_graph(tmp_path / "none.json")
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(BSGError, match="no JSON"):
        read_graph(tmp_path / "broken.json")
