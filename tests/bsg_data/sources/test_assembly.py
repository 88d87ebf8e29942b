from __future__ import annotations

import math
from typing import Any

import pytest
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import AnnotatedRoom, Annotation, SceneRef


@pytest.mark.parametrize(
    "told",
    [
        {"doors": [(0, 0)]},
        {"doors": [(0, 7)]},
        {"doors": [(0, 1)], "method": "gate"},
        {"rooms": [AnnotatedRoom(region=0, floor_area=-3.0)]},
        {"centroids": [(1.0, math.nan, 0.0), None]},
        {"centroids": [(1.0, 2.0), None]},
        {"boxes": [None, Box((0.0, 0.0, 0.0), (1.0, 1.0, math.inf))]},
    ],
)
def test_what_no_building_can_have_is_refused_with_its_place(told: dict[str, Any]) -> None:
    annotation = Annotation([0, 1], ["sink", "bed"], sha256="0" * 64, **told)
    ref = SceneRef("home", "home.json", "state")
    with refuses(SourceError, "annotation-impossible", "home.json", golden=False):
        assemble(annotation, ref=ref, kind="mine", class_map=load_class_map())
