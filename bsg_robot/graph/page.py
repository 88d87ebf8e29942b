"""The page of belief graphs as a format: `write_belief(belief, "belief.html")`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.rendering.explorer import ShownBelief, write_explorer
from bsg_robot.graph.formats import FormatRow


def _write(beliefs: Iterable[BeliefGraph], path: Path) -> None:
    write_explorer([ShownBelief(belief) for belief in beliefs], path)


HTML = FormatRow("html", (".html", ".htm"), write_all=_write)
